"""Runs say, with amounts and remedies, when they left what their model carries; what means nothing is refused."""

import re
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from benchmarks import hard_scenes
from flexclear.dynamics import analyses
from flexclear.dynamics import memory as m
from flexclear.dynamics.contact import validity
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.refusals.validity import BENT, SPIN, doubts, flexibles, largest_displacement
from flexclear.dynamics.run.run import engine_of
from flexclear.post.answers.stability import lost_energy
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import GRAVITY, joint, rigid, scene, simulate, simulated

#: first clamped-free frequency of the beam in scenes/checks/spinup_beam.toml [rad/s], as its description has it
FIRST = 3.798


def turning(speed: float, gravity: float, **more: Any) -> xr.Dataset:
    """A cantilever of 10 m on a hub that turns at a constant speed [rad/s], gravity [m/s^2] along -y."""
    override: Mapping[str, object] = {
        "body.beam.modes": {"reference": "cantilever", "count": 2, "interfaces": ["root"]},
        "drive.axle.law": {"type": "polynomial", "coefficients": [0.0, speed]},
        "load": {"g": {"type": "gravity", "acceleration": [0.0, -gravity, 0.0]}},
        "solver": {"integrator": "radau", "rtol": 1e-4} | more.pop("solver", {}),
        "time.end": 1.0,
    }
    scene = load_scene(TREE / "scenes" / "checks" / "spinup_beam.toml", override | more)
    return simulated(scene, bundles(scene))


def reported(run: xr.Dataset) -> list[str]:
    return [sentence for sentence in str(run.attrs.get("warnings", "")).split("\n") if sentence]


@pytest.mark.slow
def test_a_beam_that_bends_too_far_is_reported_with_its_deflection() -> None:
    run = turning(0.1, 9.81)
    bent, turned = reported(run)
    # the tip seen from the hub, whose x axis the undeformed beam lies along
    arm = run.frame_position.sel(frame="beam.tip").values - run.frame_position.sel(frame="beam.root").values
    angle = 0.1 * run.time.values
    straight = 10.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    far = np.linalg.norm(arm - straight, axis=1)
    assert far.max() > BENT * 10.0
    found = re.search(r"at t = (\S+) s a point is (\S+) m", bent)
    assert found is not None
    # three digits are printed
    assert float(found[2]) == pytest.approx(far.max(), rel=5e-3)
    assert float(found[1]) == pytest.approx(run.time.values[far.argmax()], rel=1e-5)
    assert "linear modes hold below 0.05" in bent
    assert "divide it" in bent
    assert "a section is rotated by" in turned


@pytest.mark.slow
def test_a_beam_that_bends_little_and_turns_slowly_has_nothing_to_say() -> None:
    assert reported(turning(0.9 * SPIN * FIRST, 0.1)) == []


@pytest.mark.slow
def test_a_beam_that_turns_fast_without_stiffening_is_reported() -> None:
    (said,) = reported(turning(2.0, 0.1))
    assert "turns at 2 rad/s, 0.53 of its first natural frequency (3.798 rad/s)" in said
    assert "stiffening = {}" in said


@pytest.mark.slow
def test_a_run_that_ends_as_its_beam_diverges_names_the_beam() -> None:
    with pytest.raises(SolverError, match="evaluations is reached") as refusal:
        turning(8.0, 9.81, solver={"evaluations": 300}, **{"time.end": 30.0})
    assert "beam: at t =" in str(refusal.value)
    assert "turns at 8 rad/s, 2.1 of its first natural frequency" in str(refusal.value)
    assert "stiffening = {}" in str(refusal.value)


def test_the_values_of_a_rejected_step_are_not_reported() -> None:
    """A run may pause right after one; what is in the work space then is no state of the motion."""
    scene = load_scene(TREE / "scenes" / "checks" / "swinging_rod.toml")
    engine = engine_of(scene, bundles(scene), silent)
    rest = consistent_start(engine)
    wild = rest.copy()
    wild[engine.model.nq : engine.model.nq + engine.model.nv] = 1e6
    engine.attempt(wild, 0.0)
    assert "it turns at" in " ".join(doubts(engine, flexibles(engine.model)))
    engine.view(m.Y)[:] = rest
    before = engine.w.copy(), engine.n.copy()
    assert doubts(engine, flexibles(engine.model)) == []
    assert np.array_equal(engine.w, before[0], equal_nan=True)
    assert np.array_equal(engine.n, before[1])


def test_the_largest_displacement_is_that_of_all_nodes_and_rows() -> None:
    random = np.random.default_rng(0)
    shapes, q = random.normal(size=(30, 3, 5)), random.normal(size=(200, 5)) * np.geomspace(1e-3, 1.0, 200)[:, None]
    every = np.linalg.norm(np.einsum("nam,tm->tna", shapes, q), axis=2).max(axis=1)
    row, size = largest_displacement(shapes, q, 0.0)
    assert row == int(every.argmax())
    assert size == pytest.approx(every.max(), rel=1e-14)  # rounding of sums of five products
    assert largest_displacement(shapes, q, 1e3) == (0, 0.0)


def dropped(depth: float) -> Scene:
    """A ball of 20 mm in a socket, with a contact so soft that it sinks in by about `depth` [m].

    m g d = K d^2.5 / 2.5, the fall through the clearance left out.
    """
    bodies = {"g": {"type": "ground", "frames": {"S": {}}}, "ball": rigid(1.0, 1e-3, {"B": {}}, pose={})}
    normal = {"law": "hertz", "stiffness": 2.5 * 9.81 / depth**1.5}
    socket = joint("clearance-spherical", "g.S", "ball.B", clearance=1e-4, ball_radius=0.02, normal=normal)
    return Scene.model_validate(scene(bodies, {"j": socket}, 0.2, 1e-8, load=GRAVITY, output={"interval": 1e-3}))


@pytest.mark.slow
def test_a_deep_contact_is_reported_and_a_ball_that_leaves_through_its_socket_refused() -> None:
    assert reported(simulated(dropped(1e-3))) == []
    (said,) = reported(simulated(dropped(5e-3)))
    assert "joint j: the penetration reaches 0.005" in said
    assert "contact laws hold below 0.1" in said
    with pytest.raises(SolverError, match=r"joint j: the penetration reached 0\.0451 m .* radius \(0\.02 m\)"):
        simulated(dropped(4.5e-2))


def door(kind: str, hinges: int) -> xr.Dataset:
    """A door of 30 kg whose mass centre is 0.45 m from its hinges, 1.5 m apart."""
    radius = {"ball_radius": 5e-3} if kind == "clearance-spherical" else {"pin_radius": 5e-3, "length": 0.03}
    heights = {f"h{k}": {"position": [0.0, 0.0, 1.5 * k]} for k in range(hinges)}
    contact = {"clearance": 5e-4, "normal": {"law": "flores", "restitution": 0.2, "stiffness": 1e9}, **radius}
    joints = {name: joint(kind, f"ground.{name}", f"door.{name}", **contact) for name in heights}
    leaf = rigid(30.0, [8.0, 10.0, 2.0], heights, pose={}, com=[0.45, 0.0, 0.75])
    return simulate(scene({"ground": {"type": "ground", "frames": heights}, "door": leaf}, joints, 2e-3, load=GRAVITY))


@pytest.mark.parametrize("hinges", [1, 2])
def test_pins_that_hold_a_door_upright_are_reported_with_their_moment(hinges: int) -> None:
    """The moment is that of the weight, 30 kg 9.81 m/s^2 0.45 m = 132.4 N m; no contact carries any of it."""
    (text,) = (text for text in reported(door("clearance-revolute", hinges)) if "parallel" in text)
    assert "joint h0: it holds its pin parallel to the axis by 132 N m" in text
    assert "by up to 0.033 rad" in text  # 2 c / L
    assert "clearance-spherical" in text


def test_a_contact_carries_its_force_times_half_its_length() -> None:
    """At either end of the pin: 100 N on 30 mm carry up to 1.5 N m."""
    pin = SimpleNamespace(length=0.03, clearance=5e-4)
    assert validity.tilting("joint p", pin, 1.49, 100.0) == ""
    assert "by 1.51 N m on average, more than its contact" in validity.tilting("joint p", pin, 1.51, 100.0)


def test_balls_and_pins_in_a_plane_hold_no_tilt() -> None:
    assert not any("parallel" in text for text in reported(door("clearance-spherical", 2)))
    for name in ("clearance_pendulum", "scotch_yoke"):
        short = load_scene(TREE / "scenes" / "checks" / f"{name}.toml", {"time.end": 0.05})
        assert not any("parallel" in text for text in reported(simulated(short)))


def test_an_ensemble_whose_balls_leave_through_their_sockets_is_refused() -> None:
    with pytest.raises(SolverError, match=r"joint j: the penetration reached 0\.0451 m"):
        analyses.ensemble(edited(dropped(4.5e-2), {"ensemble": {"members": 2}}), {}, silent)


# Energy that is off, motion that diverges ----------------------------------------------------------------------------


def bounce(solver: dict[str, Any]) -> xr.Dataset:
    """A ball falls by 0.2 m on a hard plane and rebounds without loss: 1.96 J are exchanged."""
    return simulated(hard_scenes.bounce(**solver))


@pytest.mark.parametrize(
    "solver",
    [
        {"integrator": "adams-bashforth-moulton", "step": 1e-3, "events": "at step ends"},
        {"integrator": "rk4", "step": 0.05, "events": "located"},
    ],
    ids=["contact at step ends", "a step longer than the contact"],
)
def test_a_run_that_gains_more_than_a_tenth_of_its_energy_is_refused(solver: dict[str, Any]) -> None:
    words = r"energy balance does not close.*tolerance 0\.1, \[solver\.ledger_tolerance\]"
    with pytest.raises(SolverError, match=words):
        bounce(solver)


def test_a_scene_may_allow_an_error_and_the_run_warns_of_it() -> None:
    solver = {"integrator": "rk4", "step": 0.05, "ledger_tolerance": 1.0}
    allowed = bounce(solver)
    error = float(np.abs(allowed.energy_error).max())
    assert f"the energy balance is off by {error:.3g} J" in allowed.attrs["warnings"]


def test_a_run_that_closes_warns_of_nothing() -> None:
    closed = bounce({"integrator": "dop853"})
    assert closed.attrs["warnings"] == ""
    assert np.abs(closed.energy_error).max() < 1e-6 * 1.96


SPRING = {"type": "joint-spring", "joint": "p", "stiffness": 400.0}


@pytest.mark.parametrize(
    "solver", [{}, {"rtol": 1e-6}, {"integrator": "radau", "rtol": 1e-7}, {"integrator": "exponential"}]
)
@pytest.mark.parametrize("interval", [2.0 * np.pi / 20.0, np.pi / 20.0])
def test_a_vibration_that_is_recorded_once_a_period_exchanges_its_energy(
    solver: dict[str, Any], interval: float
) -> None:
    """A mass of 1 kg on a spring, 20 rad/s, let go at 1 cm: 0.02 J go to and fro, of which no output knows."""
    bodies = {"ground": {"type": "ground", "frames": {"o": {}}}, "b": rigid(1.0, 0.01, {"o": {}})}
    bodies["b"]["pose"] = {"position": [0.0, 0.0, 0.01]}
    rail = {"p": joint("prismatic", "ground.o", "b.o")}
    more = {"load": {"s": SPRING}, "output": {"interval": interval}, "solver": solver}
    found = simulate(scene(bodies, rail, 20.0 * 2.0 * np.pi / 20.0, **more))
    # where the steps meet the motion: 0.02 J, or less by the square of what lies between two of them
    assert 0.015 < found.attrs["exchanged_energy"] < 0.0201
    assert found.attrs["warnings"] == ""
    assert float(lost_energy(found).max()) < 1e-4


@pytest.mark.parametrize("integrator", ["dop853", "exponential"])
def test_a_beam_that_rings_is_judged_between_outputs_a_period_apart(integrator: str) -> None:
    """In one of its modes: 1/2 (omega q)^2 are exchanged, by steps of many periods as well."""
    size, given = 1e-4, load_scene(TREE / "scenes" / "checks" / "clamped_rod.toml", {"load": {}})
    omega = float(np.sqrt(bundles(given)["rod"]["modal_stiffness"].values[0, 0]))
    period = 2.0 * np.pi / omega
    changes: dict[str, Any] = {
        "start": {"modal": {"rod": {"coordinate": [size]}}},
        "time.end": 8.0 * period,
        "output.interval": period,
        "solver": {"integrator": integrator, "rtol": 1e-9},
    }
    ringing = edited(given, changes)
    found = simulated(ringing, bundles(ringing))
    assert float(found.kinetic.max()) < 1e-9 * (omega * size) ** 2  # so the outputs know nothing of it
    assert found.attrs["exchanged_energy"] == pytest.approx(0.5 * (omega * size) ** 2, rel=0.5)


ROD = """title = "rod"
elements = 4
theory = "euler-bernoulli"
interfaces = ["root", "tip"]
shape = {{ type = "straight-beam", length = {length} }}
material = {{ density = 2e3, youngs_modulus = 7e10, poisson = 0.3 }}
section = {{ type = "circle", radius = {radius} }}
frames = {{ root = {{ x = 0 }}, tip = {{ x = {length} }} }}
"""


def bent(
    folder: Path, mass: float, load: float, solver: dict[str, Any], periods: float = 300.0
) -> tuple[xr.Dataset, float]:
    """A clamped rod of a mass [kg] in equilibrium under a force across its tip.

    load: as a fraction of 5 N per kg^(2/3), with which all sizes bend alike.  periods: of its first mode.  Return also
    the tip's displacement by beam theory, F l^3 / (3 E I).
    """
    size = (mass / (np.pi * 2e3 * 0.4 * 0.02**2)) ** (1 / 3)
    length, radius, force = 0.4 * size, 0.02 * size, 5.0 * size**2 * load
    end = periods * 2.0 * np.pi / (1.875**2 * (7e10 / 2e3) ** 0.5 * 0.5 * radius / length**2)
    (folder / "rod.toml").write_text(ROD.format(length=length, radius=radius))
    rod = {"type": "flexible", "mesh": str(folder / "rod.toml"), "modes": {"reference": "craig-bampton", "count": 8}}
    bodies = {"ground": {"type": "ground", "frames": {"wall": {}}}, "rod": rod}
    acting = {"push": {"type": "point-force", "frame": "rod.tip", "force": [0.0, force, 0.0]}}
    more = {"load": acting, "start": {"at": "equilibrium"}, "output": {"interval": 0.1 * end}, "solver": solver}
    table = scene(bodies, {"wall": joint("fixed", "ground.wall", "rod.root")}, end, **more)
    held = Scene.model_validate(table)
    return simulated(held, bundles(held)), force * length**3 / (3.0 * 7e10 * np.pi * radius**4 / 4.0)


@pytest.mark.parametrize("mass", [1e-9, 1.0, 1e3])
@pytest.mark.parametrize(
    "load, solver",
    [
        (1.0, {"by_need": True}),
        (1e-3, {"by_need": True}),
        (1.0, {"by_need": "integrator", "rtol": 1e-9}),
        (1.0, {"by_need": "integrator", "rtol": 1e-6}),
        (1.0, {"integrator": "exponential", "rtol": 1e-10}),
        (1.0, {"integrator": "exponential", "rtol": 1e-7}),
        (1.0, {"integrator": "radau", "rtol": 1e-7}),
    ],
)
def test_a_rod_of_any_size_is_held_in_equilibrium(
    tmp_path: Path, mass: float, load: float, solver: dict[str, Any]
) -> None:
    """It exchanges no energy: an error far below what it stores is none, and noise of the steps is no motion."""
    held, expected = bent(tmp_path, mass, load, solver)
    place = held.frame_position.sel(frame="rod.tip").values[:, 1]
    np.testing.assert_allclose(place, expected, rtol=1e-3)  # resolved to a thousandth
    assert float(lost_energy(held).max()) < 1e-3  # and the answer on stability agrees


def test_steps_over_many_vibrations_hold_a_rod_at_rest(tmp_path: Path) -> None:
    """A speed of rounding, taken for a motion through a step of a thousand periods, is no work."""
    held, expected = bent(tmp_path, 1.0, 1.0, {"integrator": "exponential", "rtol": 1e-8}, 1e5)
    np.testing.assert_allclose(held.frame_position.sel(frame="rod.tip").values[:, 1], expected, rtol=1e-6)


@pytest.mark.parametrize("mass, rtol", [(1.0, 1e-5), (1.0, 1e-6), (1e3, 1e-5), (1e3, 1e-9)])
def test_noise_beyond_the_tolerance_is_refused_at_rest(tmp_path: Path, mass: float, rtol: float) -> None:
    """Where the scene names the method whose steps its stability limits: 1e-6 leaves 1e-4 of the stored energy, and so
    a hundredth of the deflection, 1e-5 as much as there is, 1e-9 at 1 t five times the 1e-4 that it promises."""
    with pytest.raises(SolverError, match="energy balance does not close"):
        bent(tmp_path, mass, 1.0, {"integrator": "dop853", "rtol": rtol})


@pytest.mark.parametrize("force", [100.0, 1e5])
def test_a_tendon_over_coupled_joints_is_held_at_rest_up_to_rounding(force: float) -> None:
    """The torque that holds the first joint is the force times the change of length with both angles.

    A constant length gives the force no work; rounding of the positions does.
    """
    bodies = {
        "ground": {"type": "ground", "frames": {"hip": {}, "origin": {"position": [-0.05, 0.06, 0.0]}}},
        "thigh": rigid(1.0, 1e-2, {"hip": {}, "knee": {"position": [0.4, 0.0, 0.0]}}),
        "shank": rigid(1.0, 1e-2, {"knee": {}, "insert": {"position": [0.06, 0.03, 0.0]}}),
    }
    joints = {
        "hip": joint("revolute", "ground.hip", "thigh.hip"),
        "knee": joint("revolute", "thigh.knee", "shank.knee"),
    }
    tendon = {
        "type": "line-expression",
        "between": ["ground.origin", "shank.insert"],
        "force": "f",
        "values": {"f": f"{force} N"},
    }
    more = {
        "gear": {"couple": {"first": "hip", "second": "knee", "ratio": 0.5}},
        "start": {"joint": {"hip": {"position": "20 deg"}, "knee": {"position": "10 deg"}}},
        "drive": {"hip": {"joint": "hip", "law": "20 deg"}},
        "load": {"tendon": tendon},
    }
    found = simulate(scene(bodies, joints, 0.01, **more))

    def length(hip: float) -> float:
        shank = 1.5 * hip  # the knee bends by half as much, from 10 deg at 20 deg
        knee = 0.4 * np.array([np.cos(hip), np.sin(hip)])
        turned = np.array([[np.cos(shank), -np.sin(shank)], [np.sin(shank), np.cos(shank)]])
        return float(np.linalg.norm(knee + turned @ [0.06, 0.03] - [-0.05, 0.06]))

    at, step = np.radians(20.0), 1e-5
    arm = (length(at + step) - length(at - step)) / (2.0 * step)  # the difference is exact to 1e-10
    assert found.drive_force.values[:, 0] == pytest.approx(force * arm, rel=1e-8)
    assert float(lost_energy(found).max()) == 0.0


@pytest.mark.parametrize("size, end", [(1e-6, 6.0), (1.0, 6.0), (1.0, 0.3), (1e3, 0.3), (1e3, 6.0)])
def test_a_controller_that_makes_the_motion_unstable_is_refused(size: float, end: float) -> None:
    """A held force after 0.1 s: each sample multiplies the deviation by about 1 - 5000 (0.1)^2 / 2 = -24.

    Also in short runs, which end before the speed is beyond mechanics: 1 km beyond a reference of 0.1 m after 0.3 s.
    """
    bodies = {"ground": {"type": "ground", "frames": {"o": {}}}, "slide": rigid(1.0, 0.01, {"o": {}})}
    gains = {"proportional": 5000.0, "derivative": 0.0, "period": 0.1}
    load = {"c": {"type": "sampled-pid", "joint": "p", "reference": 0.1 * size, **gains}}
    rail = {"p": joint("prismatic", "ground.o", "slide.o")}
    with pytest.raises(SolverError, match=r"the motion diverges: the coordinate of controller c reached .* m"):
        simulate(scene(bodies, rail, end, load=load, output={"interval": 0.01}, solver={}))


# Stops, gears, controllers and bushings that cannot be, before anything is compiled ----------------------------------

HERTZ = {"law": "hertz", "stiffness": 1.0}
STOP = {"joint": "A", "upper": 0.1, "normal": HERTZ}
PID = {"type": "pid", "joint": "A", "reference": 1.0}
NONE = [0.0] * 6


def mount(stiffness: list[Any]) -> dict[str, Any]:
    return {"type": "bushing", "between": ["ground.O", "block.centre"], "stiffness": stiffness}


#: scene and part -> what is wrong of it, and what is said
WRONG: dict[tuple[str, str], list[tuple[dict[str, Any], tuple[str, ...]]]] = {
    ("stops", "stop.s"): [
        ({"joint": "A", "normal": HERTZ}, ("neither",)),
        (STOP | {"normal": {"law": "hertz"}}, ("normal.stiffness",)),
        (STOP | {"upper": "3 deg"}, ("stop.s.upper", "an angle", "length")),
        (STOP | {"lower": 0.2}, ("lower = 0.2", "below")),
        (STOP | {"joint": "K"}, ("stop.s.joint", "no joint 'K'")),
        (STOP | {"normal": HERTZ | {"law": "kelvin-voigt", "restitution": 0.5}}, ("effective_mass",)),
        (STOP | {"normal": HERTZ | {"law": "flores"}}, ("stop.s.normal", "restitution")),
        (STOP | {"floor": -1.0}, ("stop.s.floor", "positive")),
    ],
    ("gears", "gear.g"): [
        ({"first": "sun", "second": "sun", "ratio": 2.0}, ("couples two coordinates",)),
        ({"first": "sun", "second": "moon", "ratio": 2.0}, ("gear.g.second", "no joint 'moon'", "known: P1")),
        ({"first": "sun", "second": "P1", "ratio": "2 mm/rad"}, ("gear.g.ratio", "length per angle")),
        ({"first": "wheel", "second": "rack", "ratio": "2 N"}, ("gear.g.ratio", "length per angle", "m/rad")),
        ({"first": "sun", "second": "P1", "ratio": 0.0}, ("ratio is 0", "drive")),
        ({"first": "ring_fixed", "second": "P1", "ratio": 1.0}, ("gear.g.first", "no coordinate")),
    ],
    ("controllers", "load.c"): [
        (PID, ("needs a gain",)),
        (PID | {"reference": "3 deg", "proportional": 1.0}, ("load.c.reference", "an angle", "length")),
        (PID | {"proportional": "2 N"}, ("load.c", "a stiffness is expected")),
        (PID | {"measured": "K", "proportional": 1.0}, ("load.c.measured", "no joint 'K'")),
        (PID | {"integral": 1.0, "limits": [0.0, 1.0]}, ("tracking_time",)),
        (PID | {"integral": 1.0, "limits": [1.0, 1.0]}, ("1 is not below 1",)),
        (PID | {"type": "sampled-pid", "integral": 1.0, "period": 1e-9}, ("load.c.period", "1e+09 samples")),
    ],
    ("bushing", "load.mount"): [
        (mount([1.0, 2.0]), ("[x, y, z, rx, ry, rz]",)),
        (mount(["1 N/m", 0, 0, "1 N/m", 0, 0]), ("torsional stiffness",)),
        (mount([-1.0, 0, 0, 0, 0, 0]), ("must not be negative", "along x is -1")),
        (
            mount([[1.0, 2.0, *NONE[2:]], [1.0, 1.0, *NONE[2:]], *[NONE] * 4]),
            ("must be symmetric", "between y and x are 1 and 2", "symmetric = false allows this"),
        ),
        (
            mount([[1.0, 2.0, *NONE[2:]], [2.0, 1.0, *NONE[2:]], *[NONE] * 4]),
            ("positive semidefinite", "supply energy"),
        ),
        (
            mount([[1, 0, 2, 0, 0, 0], [0, 1, 0, 0, 0, 0], [2.0, *NONE[1:]], *[NONE] * 3]),
            ("z has none on the diagonal",),
        ),
        (mount(NONE), ("it has neither",)),
    ],
}


@pytest.mark.parametrize("scene, part, table, words", [(*at, *case) for at, cases in WRONG.items() for case in cases])
def test_what_is_no_stop_gear_controller_or_bushing_is_refused_in_words(
    scene: str, part: str, table: dict[str, Any], words: tuple[str, ...]
) -> None:
    with pytest.raises(InputError) as error:
        tabulate(build(load_scene(TREE / "scenes" / "checks" / f"{scene}.toml", {part: table}), {}))
    assert part in str(error.value)
    assert [word for word in words if word not in str(error.value)] == []
