"""Films of oil between pin and journal, and ball and socket, against closed forms and independent solutions."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
import xarray as xr
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

from flexclear.dynamics import analyses
from flexclear.dynamics.loads import film
from flexclear.dynamics.loads.given import Given
from flexclear.dynamics.loads.half_circle import half_circle
from flexclear.dynamics.sensitivity.dataset import sensitivities
from flexclear.dynamics.vectors import UNIT, ZERO, Matrix, Motion, Vector
from flexclear.scene.films import actions_of, films_of
from flexclear.scene.load import edited
from flexclear.scene.quantity import parse
from flexclear.scene.schema import Scene
from flexclear.scene.variants import effects, ideal_scene
from flexclear.system.progress import silent
from tests.properties.mechanisms import Table, matrix, rigid, scene, simulate

RADIUS, LENGTH, GAP, VISCOSITY = 0.02, 0.012, 5e-5, 0.04
ECCENTRICITIES = (0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95)
TURNED = (0.4, -0.7, 1.1)


def oiled(position: Any = (0.0, 0.0, 0.0), velocity: Any = (0.0, 0.0, 0.0), end: float = 0.01, **more: Any) -> Table:
    """A pin of 2 kg in a fixed journal; more: of the film, and keys of the joint as `joint`, of the pin as `pin`."""
    own, pin = more.pop("joint", {}), more.pop("pin", {})
    kind = own.get("type", "clearance-revolute")
    sizes: Table = {"pin_radius": RADIUS, "length": LENGTH} if kind == "clearance-revolute" else {"ball_radius": RADIUS}
    found = {
        "type": kind,
        "between": ["ground.o", "pin.o"],
        "clearance": GAP,
        **sizes,
        "normal": {"law": "hertz", "stiffness": 1e9},
        "film": {"viscosity": VISCOSITY} | more,
    }
    moving = {"pose": {"position": list(position)}, "velocity": list(velocity)} | pin
    bodies = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "pin": rigid(2.0, [1e-3, 1e-3, 2e-3], {"o": {}}) | moving,
    }
    return scene(bodies, {"A": found | own}, end)


def acting(
    e: Any, v: Any, omega: tuple[float, float] = (0.0, 0.0), turn: Any = (0.0, 0.0, 0.0), **film_keys: Any
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return force and torque on the pin, and the lost power, at an eccentricity over the clearance and a velocity.

    omega: of journal and pin [rad/s].  turn: rotation vector of the journal, in whose axes vectors are given.
    """
    R = matrix(turn)
    found = actions_of(Scene.model_validate(oiled(**film_keys)))["A.film"]
    numbers = film.row(found, "").numbers
    x, y, z = (
        Vector((R @ np.array(one)).tolist()) for one in (np.array([*e, 0.0][:3]) * GAP, [*v, 0.0][:3], (0, 0, 1))
    )
    own = ((ZERO, omega[0], ZERO), (x, omega[1], y))
    F, G = (Motion(Matrix(R.ravel().tolist()), p, z * w, u, ZERO, ZERO) for p, w, u in own)
    load = film.apply(Given(numbers, (), (), F, G, UNIT, (), (), ()), found.kind)
    return R.T @ np.array(load.wrench.force), R.T @ np.array(load.wrench.moment), float(load.lost)


def towards(eccentricity: float, angle: float) -> list[float]:
    return [eccentricity * np.cos(angle), eccentricity * np.sin(angle)]


# Pins ----------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
@pytest.mark.parametrize("speeds", [(0.0, 300.0), (300.0, 0.0), (80.0, 220.0), (-40.0, -260.0)])
def test_a_short_bearing_carries_ocvirks_load_at_his_attitude(eccentricity: float, speeds: tuple[float, float]) -> None:
    """W = mu w R L^3/(4 c^2) e/(1-e^2)^2 sqrt(16 e^2 + pi^2 (1-e^2)), tan(phi) = pi sqrt(1-e^2)/(4 e) (Ocvirk 1953)."""
    e, w, at = eccentricity, sum(speeds), 0.7
    force, torque, lost = acting(towards(e, at), (0.0, 0.0), speeds, TURNED, model="short")
    load = VISCOSITY * abs(w) * RADIUS * LENGTH**3 / (4 * GAP**2) * e / (1 - e**2) ** 2
    load *= np.sqrt(16 * e**2 + np.pi**2 * (1 - e**2))
    assert np.linalg.norm(force) == pytest.approx(load, rel=1e-10)
    # the journal carries the pin towards its turning, ahead of the load on the pin by the attitude
    attitude = np.arctan2(np.pi * np.sqrt(1 - e**2), 4 * e)
    direction = np.arctan2(-force[1], -force[0])
    assert np.sin(direction + np.sign(w) * attitude - at) == pytest.approx(0.0, abs=1e-10)
    assert np.cos(direction + np.sign(w) * attitude - at) > 0.0
    # Petroff's torque over sqrt(1-e^2), and half of the load's moment
    petroff = 2 * np.pi * VISCOSITY * RADIUS**3 * LENGTH / (GAP * np.sqrt(1 - e**2)) * (speeds[1] - speeds[0])
    across = 0.5 * e * GAP * load * np.sin(attitude) * np.sign(w)
    assert torque == pytest.approx([0.0, 0.0, -petroff - across], rel=1e-9, abs=1e-12)
    assert lost == pytest.approx(petroff * (speeds[1] - speeds[0]) + across * w, rel=1e-9)


@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
def test_a_long_bearing_carries_sommerfelds_load_on_half_of_the_journal(eccentricity: float) -> None:
    """Components 6 mu w R^3 L/c^2 times 2 e^2/((2+e^2)(1-e^2)) and pi e/((2+e^2) sqrt(1-e^2)) (Sommerfeld 1904)."""
    e, w = eccentricity, 300.0
    force = acting(towards(e, 0.0), (0.0, 0.0), (0.0, w), model="long")[0]
    scale = 6 * VISCOSITY * w * RADIUS**3 * LENGTH / GAP**2 / (2 + e**2)
    wanted = -2 * e**2 / (1 - e**2), np.pi * e / np.sqrt(1 - e**2)
    assert force[:2] / scale == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("eccentricity", [-0.9, -0.4, 0.0, 0.4, 0.9, 0.99])
def test_a_pin_is_squeezed_out_as_the_integrals_over_half_the_journal_say(eccentricity: float) -> None:
    """Force over speed by quadrature of the pressure, 1/h^3 for the short bearing, 1/h^2 - 1 for the long one."""
    e, v = eccentricity, 0.01
    short = acting(towards(e, 0.0), (v, 0.0), model="short")[0]
    long = acting(towards(e, 0.0), (v, 0.0), model="long")[0]
    carried = quad(lambda t: np.cos(t) ** 2 / (1 - e * np.cos(t)) ** 3, -np.pi / 2, np.pi / 2, epsrel=1e-12)[0]
    assert short[0] == pytest.approx(-VISCOSITY * RADIUS * (LENGTH / GAP) ** 3 * carried * v, rel=1e-8)
    # h^3 dp/dt = -12 mu R^2 v sin(t), whose moment by parts is that of sin^2/h^3
    carried = quad(lambda t: np.sin(t) ** 2 / (1 - e * np.cos(t)) ** 3, -np.pi / 2, np.pi / 2, epsrel=1e-12)[0]
    assert long[0] == pytest.approx(-12 * VISCOSITY * LENGTH * (RADIUS / GAP) ** 3 * carried * v, rel=1e-8)
    assert abs(short[1]) < 1e-9 * abs(short[0])
    assert abs(long[1]) < 1e-9 * abs(long[0])


def in_two_dimensions(e: float, angle: float, length: float, around: int, along: int) -> np.ndarray:
    """Return the force on the pin over that of the concentric short bearing, by finite differences.

    The pin moves along x.  e: eccentricity, at `angle` from x.  length: over the radius.
    """
    psi = np.linspace(-np.pi / 2, np.pi / 2, around + 1)
    d, z = psi[1] - psi[0], length / (2 * along)  # half the length, symmetric about its first row
    cubed = (1 - e * np.cos(psi - angle)) ** 3
    mid = (1 - e * np.cos(0.5 * (psi[1:] + psi[:-1]) - angle)) ** 3
    inner = around - 1
    A = sparse.diags([mid[1:-1], -(mid[1:] + mid[:-1]), mid[1:-1]], [-1, 0, 1]) / d**2
    B = sparse.diags([np.ones(along - 1), -2 * np.ones(along), np.ones(along - 1)], [-1, 0, 1]).tolil()
    B[0, 1] = 2.0
    whole = sparse.kron(A, sparse.eye(along)) + sparse.kron(sparse.diags(cubed[1:-1]), B / z**2)
    p = spsolve(whole.tocsc(), np.repeat(-12 * np.cos(psi[1:-1]), along)).reshape(inner, along)
    line = 2 * z * (p.sum(axis=1) - 0.5 * p[:, 0])
    return -np.array([line @ np.cos(psi[1:-1]), line @ np.sin(psi[1:-1])]) * d / length**3


@pytest.mark.parametrize("slender", [0.25, 1.0, 2.0, 4.0])
def test_a_finite_bearing_carries_what_reynolds_equation_in_two_dimensions_gives(slender: float) -> None:
    """Largest difference over eccentricities and directions, of the whole force; length: over the radius."""
    worst = 0.0
    for e, angle in [(0.02, 1.0), (0.4, 0.3), (0.4, 1.57), (0.4, 2.8), (0.8, 0.0), (0.8, 1.2), (0.8, 1.57), (0.8, 2.2)]:
        coarse, fine = (in_two_dimensions(e, angle, slender, n, n // 4) for n in (120, 240))
        wanted = (4 * fine - coarse) / 3
        joint = {"length": slender * RADIUS}
        found = acting(towards(e, angle), (1.0, 0.0), joint=joint)[0][:2]
        found = found / (VISCOSITY * RADIUS * (slender * RADIUS / GAP) ** 3)
        worst = max(worst, float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted)))
    # 1.3e-4 at most, of the fit of order ten
    assert worst < 3e-3


def test_a_film_takes_energy_in_every_motion_and_thickness() -> None:
    """Beyond the wall, too; and its force has no step where the dry contact begins."""
    random = np.random.default_rng(3)
    for model in ("short", "long", "finite"):
        for e in (0.0, 0.5, 0.9989, 0.9995, 1.001):
            for angle in random.uniform(-np.pi, np.pi, 8):
                *_, lost = acting(towards(e, angle), random.normal(size=2), tuple(random.normal(size=2)), model=model)
                assert lost > 0.0
        # the roughness is a thousandth of the clearance
        near, in_contact = (acting((0.999 + s, 0.0), (0.1, 0.05), model=model)[0] for s in (-1e-9, 1e-9))
        # slope: force over the thickness left, times a few
        assert in_contact == pytest.approx(near, rel=1e-4)


# Balls ---------------------------------------------------------------------------------------------------------------
BALL: Table = {"type": "clearance-spherical"}


@pytest.mark.parametrize("eccentricity", [-0.9, -0.04, 0.0, 0.03, 0.06, 0.5, 0.95])
def test_a_ball_is_squeezed_as_the_pressure_on_its_half_says(eccentricity: float) -> None:
    """dp/dt = -6 mu R^2 v sin(t)/h^3, with no pressure at the edge, by quadrature."""
    e, v = eccentricity, 0.02
    force, _, lost = acting((0.0, 0.0, e), (0.0, 0.0, v), turn=TURNED, joint=BALL)
    # by parts: the area inside of t is pi R^2 sin^2
    carried = quad(lambda t: np.sin(t) ** 3 / (1 - e * np.cos(t)) ** 3, 0.0, np.pi / 2, epsrel=1e-12)[0]
    wanted = 6 * np.pi * VISCOSITY * RADIUS * (RADIUS / GAP) ** 3 * v * carried
    assert force == pytest.approx([0.0, 0.0, -wanted], rel=1e-8, abs=1e-9 * wanted)
    assert lost == pytest.approx(wanted * v, rel=1e-8)


@pytest.mark.parametrize("eccentricity", [0.0, 0.03, 0.06, 0.5, 0.95])
def test_a_ball_moves_across_its_eccentricity_as_reynolds_equation_says(eccentricity: float) -> None:
    """P = 12 mu R^2 v sin(t) cos(phi) (1/h^2 + 1/h)/(4 + e^2) on the half that the ball approaches."""
    e, v = eccentricity, 0.02
    force = acting((e, 0.0, 0.0), (0.0, v, 0.0), joint=BALL)[0]
    h = lambda t: 1 - e * np.cos(t)  # noqa: E731
    carried = quad(lambda t: np.sin(t) ** 3 * (1 / h(t) ** 2 + 1 / h(t)), 0.0, np.pi, epsrel=1e-12)[0]
    wanted = 12 * VISCOSITY * RADIUS * (RADIUS / GAP) ** 3 * v / (4 + e**2) * np.pi / 2 * carried
    assert force == pytest.approx([0.0, -wanted, 0.0], rel=1e-9, abs=1e-9 * wanted)


# Runs ----------------------------------------------------------------------------------------------------------------
def carried_to(eccentricity: float, viscosity: float = VISCOSITY) -> float:
    """Return the impulse over clearance that a short film has taken from the middle to an eccentricity [N s]."""
    e = eccentricity
    D = 4 * np.arctan(np.sqrt((1 + e) / (1 - e)))
    slope = 2 / (1 - e**2) + D * e / (1 - e**2) ** 1.5 - 2.0  # integral of that of 2 cos^2/h^3
    return 0.5 * viscosity * RADIUS * (LENGTH / GAP) ** 3 * slope * GAP


def test_a_pin_that_is_thrown_at_its_journal_stops_where_the_film_has_taken_its_momentum() -> None:
    """M (v0 - v) is the integral of the resistance over the path; the stop's derivative by the viscosity."""
    ends = brentq(lambda e: carried_to(e) - 2.0 * 0.2, 0.0, 0.999)
    table = oiled(velocity=[0.0, 0.2, 0.0], end=0.02, model="short")
    found = simulate(table)
    e, v = found.contact_offset.values[:, 0, 1] / GAP, found.velocity.values[:, 0, 1]
    assert 2.0 * (0.2 - v) == pytest.approx([carried_to(one) for one in e], abs=1e-9)
    assert e[-1] == pytest.approx(ends, rel=1e-8)
    assert np.abs(found.energy_error).max() < 1e-8 * found.kinetic.max()
    assert found.load_loss.values[-1] == pytest.approx(0.5 * 2.0 * 0.2**2, rel=1e-8)
    assert "event_time" not in found or not found.event_time.size
    made = Scene.model_validate(table)
    by = sensitivities(made, {}, silent, ["pin.position.y"], ["joint.A.film.viscosity"])["pin.position.y"].values[0, -1]
    step = 1e-6
    wanted = [brentq(lambda e, m=m: carried_to(e, m) - 0.4, 0.0, 0.999) for m in (VISCOSITY - step, VISCOSITY + step)]
    assert by == pytest.approx(GAP * (wanted[1] - wanted[0]) / (2 * step), rel=1e-5)


def test_a_pin_that_the_film_cannot_stop_meets_the_rough_wall_once_and_comes_back() -> None:
    """The contact is located where the film is as thin as the roughness; the books close."""
    hard = {"normal": {"law": "hertz", "stiffness": 1e14}}
    thin: Table = {"viscosity": 1e-3, "roughness": 0.05 * GAP, "joint": hard}
    found = simulate(oiled(velocity=[0.0, 3.0, 0.0], end=4e-5, model="short", **thin))
    closing = found.isel(event=found.event_kind.values == "closing")
    assert closing.event_time.size == 1
    speed = 3.0 - carried_to(0.95, 1e-3) / 2.0
    assert closing.event_approach_speed.values == pytest.approx([speed], rel=1e-8)
    assert found.contact_gap.min() < 0.0
    assert np.abs(found.energy_error).max() < 1e-8 * found.kinetic.max()


def test_pin_and_journal_that_turn_freely_keep_their_momentum() -> None:
    """Both bodies move and turn; the film acts on both alike, whichever is named first."""
    table = oiled([1e-5, 2e-5, 0.0], [0.1, -0.2, 0.0], 0.005, pin={"angular_velocity": [0.0, 0.0, 200.0]})
    turning = {"pose": {}, "angular_velocity": [0.0, 0.0, -70.0]}
    table["body"]["ground"]["frames"] = {}
    table["body"]["ring"] = rigid(3.0, [2e-3, 2e-3, 3e-3], {"o": {}}, **turning)
    ends = ["ring.o", "pin.o"]
    table["joint"]["A"]["between"] = ends[::-1]
    swapped = simulate(table)
    table["joint"]["A"]["between"] = ends
    found = simulate(table)
    # integrated to 1e-12 of a mechanism's size; of 50 um
    assert swapped.position.values == pytest.approx(found.position.values, abs=1e-6 * GAP)
    pushed = found.joint_force.sel(joint="A").values
    assert pushed == pytest.approx(2.0 * found.acceleration.sel(body="pin").values, abs=1e-9 * np.abs(pushed).max())
    assert found.film_force.sel(film="A").values == pytest.approx(pushed, abs=1e-12 * np.abs(pushed).max())
    masses, moments = xr.DataArray([2.0, 3.0], {"body": ["pin", "ring"]}), [2e-3, 3e-3]
    linear = (masses * found.velocity).sum("body")
    own = found.angular_velocity.sel(axis="z") * xr.DataArray(moments, {"body": ["pin", "ring"]})
    x, v = found.position, found.velocity
    orbital = masses * (x.sel(axis="x") * v.sel(axis="y") - x.sel(axis="y") * v.sel(axis="x"))
    angular = (own + orbital).sum("body").values
    assert linear.values == pytest.approx(np.broadcast_to([0.2, -0.4, 0.0], linear.shape), abs=1e-11)
    assert angular == pytest.approx(np.full(len(angular), angular[0]), abs=1e-11)
    assert np.abs(found.energy_error).max() < 1e-8 * found.kinetic.max()


def coefficients(e: float, load: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping of a short bearing, axes along and across the load (Friswell et al. 2010, 5.5)."""
    p, s, h = np.pi**2, np.sqrt(1 - e**2), (np.pi**2 * (1 - e**2) + 16 * e**2) ** -1.5
    last = 32 * e**2 * (1 + e**2)
    K = [
        [4 * h * (p * (2 - e**2) + 16 * e**2), h * np.pi * (p * (1 - e**2) ** 2 - 16 * e**4) / (e * s)],
        [-h * np.pi * (p * (1 - e**2) * (1 + 2 * e**2) + last) / (e * s), 4 * h * (p * (1 + 2 * e**2) + last / s**2)],
    ]
    across = -8 * h * (p * (1 + 2 * e**2) - 16 * e**2)
    C = [
        [2 * np.pi * h * s * (p * (1 + 2 * e**2) - 16 * e**2) / e, across],
        [across, 2 * np.pi * h * (p * (1 - e**2) ** 2 + 48 * e**2) / (e * s)],
    ]
    return np.array(K) * load / GAP, np.array(C) * load / (GAP * speed)


def heaviest(K: np.ndarray, C: np.ndarray) -> float:
    """Return the mass above which a rigid rotor whirls in its oil, infinite where none does (Routh and Hurwitz)."""
    k = (K[0, 0] * C[1, 1] + K[1, 1] * C[0, 0] - K[0, 1] * C[1, 0] - K[1, 0] * C[0, 1]) / np.trace(C)
    squared = ((k - K[0, 0]) * (k - K[1, 1]) - K[0, 1] * K[1, 0]) / np.linalg.det(C)
    return float(k / squared) if squared > 0.0 else np.inf


@pytest.mark.parametrize("e, share", [(0.3, 0.98), (0.3, 1.02), (0.7, 0.98), (0.7, 1.02), (0.8, np.inf)])
def test_a_rigid_rotor_whirls_in_its_oil_from_the_known_threshold_on(e: float, share: float) -> None:
    """All vibrations are those of the known coefficients.

    share: mass over the threshold's; where the pin runs closer than 0.75 there is none.
    """
    speed = 400.0
    load = VISCOSITY * speed * RADIUS * LENGTH**3 / (4 * GAP**2) * e / (1 - e**2) ** 2
    load *= np.sqrt(16 * e**2 + np.pi**2 * (1 - e**2))
    K, C = coefficients(e, load, speed)
    assert np.isinf(heaviest(K, C)) == np.isinf(share)
    mass = 1e4 if np.isinf(share) else share * heaviest(K, C)
    attitude = np.arctan2(np.pi * np.sqrt(1 - e**2), 4 * e)
    start = np.array([np.sin(attitude), -np.cos(attitude), 0.0]) * e * GAP
    table = oiled(start, model="short", pin={"angular_velocity": [0.0, 0.0, speed], "mass": mass})
    table["joint"]["turning"] = {"type": "planar", "between": ["ground.o", "pin.o"]}
    law = {"type": "polynomial", "coefficients": [0.0, speed]}
    table["drive"] = {"motor": {"joint": "turning", "coordinate": "rotation", "law": law}}
    table["load"] = {"weight": {"type": "gravity", "acceleration": [0.0, -load / mass, 0.0]}}
    found = analyses.frequencies(Scene.model_validate(table), {}, silent, moving=True)
    wanted = np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], [-K / mass, -C / mass]]))
    known = 2j * np.pi * found.frequency.values - found.decay_rate.values
    for one in wanted[wanted.imag > 0.0]:
        # poses are found to a balance of forces, which leaves some 1e-9 of the eccentricity
        assert np.abs(known - one).min() < 1e-6 * abs(one)
    assert (found.attrs["growth"] > 0.0) == (1.0 < share < np.inf)


def test_a_thin_film_in_a_wide_gap_is_integrated_by_a_method_of_the_programs_choice() -> None:
    """A pin is pressed until 1 um of 100 um of oil is left, then thrown aside; reference: Radau of SciPy."""
    gap, push = 1e-4, 200.0
    start = [0.0, 0.985 * gap, 0.0]
    table = oiled(start, [0.01, 0.0, 0.0], 0.02, model="short", joint={"clearance": gap})
    table["load"] = {"weight": {"type": "gravity", "acceleration": [0.0, push, 0.0]}}
    del table["solver"]
    found = simulate(table)
    k = VISCOSITY * RADIUS * (LENGTH / gap) ** 3

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        e, v = y[:2] / gap, y[2:]
        u = v / np.linalg.norm(v)
        (along, _), b = half_circle(e @ u, u[0] * e[1] - u[1] * e[0])[0], u[0] * e[1] - u[1] * e[0]
        across = half_circle(e @ u, b)[0][1]
        force = -k * (along * v + b * across * np.array([-v[1], v[0]]))
        return np.concatenate([v, force / 2.0 + [0.0, push]])

    known = solve_ivp(rate, (0.0, 0.02), [*start[:2], 0.01, 0.0], method="Radau", rtol=1e-9, atol=1e-16).y[:, -1]
    assert np.hypot(*known[:2]) > 0.98 * gap
    # the program's own tolerance is 1e-8 of the mechanism's size
    assert found.contact_offset.values[-1, 0, :2] == pytest.approx(known[:2], abs=1e-4 * gap)
    assert not found.event_time.size if "event_time" in found else True


# Scenes --------------------------------------------------------------------------------------------------------------
REFUSED: dict[str, tuple[Table, str]] = {
    "rough": ({"roughness": 2 * GAP}, "must be below the clearance"),
    "smooth": ({"roughness": 1e-6 * GAP}, "at least 0.0001 of it"),
    "pulling": ({"viscosity": -0.1}, "greater than 0"),
    "unit": ({"viscosity": "1 Pa"}, "viscosity"),
    "model": ({"model": "thick"}, "'short', 'long' or 'finite'"),
    "tilting": ({"joint": {"axial_clearance": 1e-3}}, "film of a pin that tilts is not computed"),
    "ball": ({"joint": BALL, "model": "short"}, "model"),
    "slot": ({"joint": {"type": "clearance-slot", "travel": 0.1, "pin_radius": RADIUS, "length": LENGTH}}, "film"),
    "length": ({"joint": {"length": None}}, "length"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_film_that_cannot_be_is_refused_in_words(case: str) -> None:
    changed, words = REFUSED[case]
    with pytest.raises(ValueError, match=words):
        Scene.model_validate(oiled(**changed))


def test_a_film_is_an_effect_of_its_own_and_goes_with_the_clearance() -> None:
    made = Scene.model_validate(oiled())
    assert {effect.name for effect in effects(made)} == {"joint.A.clearance", "joint.A.film"}
    assert not films_of(ideal_scene(made))
    assert parse("A.film_thickness", made.owners()).terms()[0].kind == "film_thickness"
    dry = edited(made, {"joint.A.film": None})
    assert not actions_of(dry)
