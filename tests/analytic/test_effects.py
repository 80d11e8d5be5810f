"""Stops, gears, controllers and bushings against closed forms."""

import numpy as np
import pytest
import xarray as xr
from scipy.linalg import expm
from scipy.optimize import brentq

from flexclear import dynamics
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.mobility import analyse
from flexclear.dynamics.model.model import tabulate
from flexclear.scene.load import load_scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles, frequencies, impacts, run
from tests.properties.mechanisms import rigid, scene, simulate

STOPS = "checks/stops"


def test_a_slide_between_lossless_ends_repeats_itself_by_half_sines() -> None:
    dataset = run(STOPS)
    mass, stiffness, lower, upper = 2.0, 2e5, -0.05, 0.1
    omega = np.sqrt(stiffness / mass)
    contact, way = np.pi / omega, upper - lower
    period = 2.0 * (way + contact)

    def coordinate(t: float) -> float:
        t = (t - lower) % period  # from the lower end on, upwards at 1 m/s
        if t < way:
            return lower + t
        if t < way + contact:
            return upper + np.sin(omega * (t - way)) / omega
        if t < 2.0 * way + contact:
            return upper - (t - way - contact)
        return lower - np.sin(omega * (t - 2.0 * way - contact)) / omega

    known = [coordinate(t) for t in dataset.time.values]
    # six contacts at rtol 1e-10, each located to 1e-12 of the way
    assert dataset.joint_position.sel(coordinate="A").values == pytest.approx(known, abs=1e-8)
    first = impacts(dataset, contact="A.upper")
    assert first["start"][0] == pytest.approx(0.1, abs=1e-11)
    assert first["duration"] == pytest.approx(contact, rel=1e-7)
    assert first["peak_force"] == pytest.approx(np.sqrt(stiffness * mass), rel=1e-7)
    assert dataset.contact_impulse.sel(contact="A.lower").values[-1] == pytest.approx(
        2.0 * mass * len(impacts(dataset, contact="A.lower")["start"]), rel=1e-7
    )


def test_a_linear_damper_gives_the_restitution_that_was_asked_for() -> None:
    dataset = run(STOPS)
    found = impacts(dataset, contact="B.upper")
    assert found["start"] == pytest.approx([0.05], abs=1e-11)
    speed = dataset.joint_velocity.sel(coordinate="B").values[-1]
    assert speed == pytest.approx(-0.6, rel=1e-7)
    # with K, m = 1: d = sin(w t) exp(-z t)/w; the end is where d + 2 z d' = 0
    unit = np.sqrt(1e5 / 1.0)

    def end(z: float) -> tuple[float, float]:
        w = np.sqrt(1.0 - z * z)

        def depth(t: float) -> tuple[float, float]:
            return np.exp(-z * t) * np.sin(w * t) / w, np.exp(-z * t) * (np.cos(w * t) - z / w * np.sin(w * t))

        t = brentq(lambda t: depth(t)[0] + 2.0 * z * depth(t)[1], 0.5, np.pi / w, xtol=1e-14)
        return t, -depth(t)[1]

    ratio = brentq(lambda z: end(z)[1] - 0.6, 1e-3, 0.9)
    lost = 0.5 * (1.0 - 0.6**2)
    assert dataset.contact_damping_loss.sel(contact="B.upper").values[-1] + 0.0 == pytest.approx(lost, rel=1e-6)
    # the largest force is that of the first instant, C v, where the damping is strong, or later
    assert found["peak_force"][0] >= 2.0 * ratio * unit * (1.0 - 1e-9)


@pytest.mark.parametrize(
    "coordinate, ends, speed",
    [("C", {"C.upper": 7.0, "C.lower": -8.0}, 40.0), ("D", {"E.upper": 9.0, "D.lower": -1.0}, 30.0)],
    ids=["in the tree", "in a loop"],
)
def test_angles_reach_their_ends_beyond_a_full_turn(coordinate: str, ends: dict[str, float], speed: float) -> None:
    dataset, now, angle, velocity = run(STOPS), 0.0, 0.0, speed
    for name, limit in ends.items():
        found = impacts(dataset, contact=name)
        now += (limit - angle) / velocity
        # located at rtol 1e-10 of some radians
        assert found["start"][0] == pytest.approx(now, abs=1e-8)
        assert found["approach"][0] == pytest.approx(abs(velocity), rel=1e-9)
        now, angle, velocity = now + found["duration"][0], limit, -0.5 * velocity
        assert found["separation"][0] == pytest.approx(abs(velocity), rel=1e-7)
    series = dataset.joint_velocity.sel(coordinate=coordinate).values
    assert series[-1] == pytest.approx(velocity, rel=1e-7)
    assert np.abs(dataset.energy_error.values).max() < 1e-6


def test_a_start_beyond_an_end_is_refused_unless_its_speed_is_given() -> None:
    place = ("stop.A.upper", "-20 mm")
    with pytest.raises(InputError, match=r"(?s)stop\.A.*0\.02 m beyond -0\.02 m.*set upper to 0\.003 m"):
        run(STOPS, (place,))
    reported = run(STOPS, (place, ("stop.A.initial_approach_speed", "1 m/s"), ("time.end", "10 ms")))
    # from 20 mm deep, at 1 m/s
    omega = np.sqrt(2e5 / 2.0)
    t = reported.time.values
    known = -0.02 + 0.02 * np.cos(omega * t) + np.sin(omega * t) / omega
    inside = known > -0.02
    assert reported.joint_position.sel(coordinate="A").values[inside] == pytest.approx(known[inside], abs=1e-10)


def test_the_force_of_an_end_pushes_the_second_body_back_along_or_about_the_axis() -> None:
    dataset = run(STOPS)
    for end, sense in (("A.upper", -1.0), ("A.lower", 1.0), ("C.upper", -1.0), ("D.lower", 1.0)):
        mine = dataset.sel(contact=end)
        expected = np.outer(sense * mine.contact_normal_force.values, [0.0, 0.0, 1.0])
        assert np.abs(expected).max() > 0.0
        # all axes are the world's z, rotors turned about it
        assert mine.contact_force.values == pytest.approx(expected, rel=1e-12, abs=1e-12)


# Gears and racks: Willis' equation, equivalent inertia, reactions; what repeats is redundant -------------------------

GEARS = "checks/gears"
G = 9.81


def test_a_planetary_train_turns_by_willis_equation() -> None:
    dataset = run(GEARS)
    speed = {name: dataset.joint_velocity.sel(coordinate=name).values for name in dataset.coordinate.values}
    # ring fixed: sun = (1 + 90/30) carrier; planet = (1 - 90/30) carrier against the ground; closed to rounding
    assert speed["sun_bearing"] == pytest.approx(4.0 * speed["carrier"], abs=1e-9)
    for planet in ("P1", "P2", "P3"):
        assert speed[planet] + speed["carrier"] == pytest.approx(-2.0 * speed["carrier"], abs=1e-9)
    # the brake of 0.5 N m at the sun turns all of it: inertia and torque reduced to the carrier
    planets = 3.0 * (0.2 * 0.09**2 + 2e-4 * 2.0**2)
    inertia = 0.02 + 0.002 * 4.0**2 + planets
    known = -0.5 * 4.0 / inertia * dataset.time.values
    # rtol 1e-10 of some tens of rad/s
    assert speed["carrier"] == pytest.approx(known, abs=1e-7)
    assert dataset.joint_position.sel(coordinate="carrier").values == pytest.approx(
        0.5 * known * dataset.time.values, abs=1e-7
    )


def test_a_rack_falls_as_its_mass_and_the_reduced_inertia_say() -> None:
    dataset = run(GEARS)
    reduced = 0.5 + 0.004 / 0.1**2
    fall = -0.5 * G / reduced
    t = dataset.time.values
    assert dataset.joint_position.sel(coordinate="rack").values == pytest.approx(0.5 * fall * t**2, abs=1e-9)
    wheel = dataset.joint_velocity.sel(coordinate="wheel").values
    assert wheel == pytest.approx(-fall * t / 0.1, abs=1e-7)
    # what the teeth hold the rack with: its weight less its acceleration
    assert dataset.gear_force.sel(gear="rack").values == pytest.approx(0.5 * (G + fall), rel=1e-9)


def test_torques_of_the_teeth_accelerate_a_planet() -> None:
    """Both gears of all planets turn them: what the dependent ones carry is nothing, the sum is determined."""
    dataset = run(GEARS)
    carrier = -2.0 / (0.02 + 0.002 * 16.0 + 3.0 * (0.2 * 0.09**2 + 8e-4))
    total = sum(dataset.gear_force.sel(gear=f"{kind}{k}").values for k in (1, 2, 3) for kind in "SR")
    assert total == pytest.approx(3.0 * 2e-4 * (-2.0 * carrier), abs=1e-8)
    assert np.abs(dataset.energy_error.values).max() < 1e-8 * np.abs(dataset.load_work.values).max()


def test_gears_count_in_the_mobility_and_repeated_ones_as_redundant() -> None:
    model = tabulate(build(load_scene(TREE / "scenes" / f"{GEARS}.toml"), {}))
    found = analyse(model)
    # one of the train, one of rack and pinion; five rows of the sun's second bearing, its ring's as well, and the
    # gears of two planets that repeat the ratio of sun and ring
    assert found.mobility == 2
    assert found.redundant == found.rows - (model.nv - 2)
    without = load_scene(TREE / "scenes" / f"{GEARS}.toml")
    fewer = without.model_copy(update={"gear": {k: v for k, v in without.gear.items() if k not in ("S3", "R3")}})
    assert analyse(tabulate(build(fewer, {}))).mobility == 3
    one = without.model_copy(update={"gear": {k: v for k, v in without.gear.items() if k != "R3"}})
    assert analyse(tabulate(build(one, {}))).redundant == found.redundant - 1


def crank(*changes: tuple[str, object]) -> xr.Dataset:
    """The slider-crank with a flexible rod, let go at speed without a drive."""
    free = {"drive": {}, "body.crank.angular_velocity": (0.0, 0.0, 150.0), "time.end": "10 ms"}
    scene = load_scene(TREE / "scenes" / "checks" / "flexible_slider_crank.toml", {**free, **dict(changes)})
    return dynamics.simulate(scene, bundles(scene), silent)


def wheel(name: str, inertia: float, joint: str, ratio: float) -> list[tuple[str, object]]:
    """A wheel on the ground that is geared to a joint."""
    body = {"type": "rigid", "mass": 1.0, "inertia": [inertia] * 3, "pose": {}, "frames": {"axis": {}}}
    revolute = {"type": "revolute", "between": ["ground.main", f"{name}.axis"]}
    gear = {"first": joint, "second": name, "ratio": ratio}
    return [(f"body.{name}", body), (f"joint.{name}", revolute), ("gear", {name: gear})]


@pytest.mark.slow
def test_a_geared_flywheel_is_inertia_of_the_crank_of_a_flexible_mechanism() -> None:
    known = crank(("body.crank.inertia", (0.002727, 0.002727, 0.002727 + 4.0 * 2e-4)))
    geared = crank(*wheel("flywheel", 2e-4, "main", -2.0))
    turn = "main"
    for name in ("joint_position", "joint_velocity"):
        one, other = (run[name].sel(coordinate=turn).values for run in (known, geared))
        # rtol 1e-10 of 150 rad/s and its stiff rod over some hundred steps
        assert other == pytest.approx(one, abs=1e-6 * np.abs(one).max()), name
    assert geared.joint_velocity.sel(coordinate="flywheel").values == pytest.approx(
        -2.0 * geared.joint_velocity.sel(coordinate=turn).values, abs=1e-9
    )


@pytest.mark.slow
def test_a_gear_on_the_pin_of_a_flexible_rod_takes_no_energy() -> None:
    """The pin's angle has the rod's deformation in it; what the gear does there and at the wheel cancels."""
    geared = crank(*wheel("follower", 5e-5, "crank_pin", 1.5))
    pin, follower = (geared.joint_velocity.sel(coordinate=name).values for name in ("crank_pin", "follower"))
    assert follower == pytest.approx(1.5 * pin, abs=1e-8)
    assert np.ptp(follower) > 10.0
    # integrated at rtol 1e-10 over some hundred steps
    assert np.abs(geared.energy_error).max() < 1e-7 * geared.kinetic.max()


# PID controllers against matrix exponentials, a sampled one against its exact discretisation -------------------------

CONTROLLERS = "checks/controllers"


def linear(A: list[list[float]], start: list[float], times: np.ndarray) -> np.ndarray:
    return np.array([expm(t * np.array(A)) @ start for t in times])


@pytest.mark.parametrize(
    "coordinate, inertia, stiffness, damping, target", [("A", 2.0, 200.0, 8.0, 0.1), ("D", 0.03, 3.0, 0.1, 9.0)]
)
def test_a_step_is_answered_as_a_system_of_second_order_does(
    coordinate: str, inertia: float, stiffness: float, damping: float, target: float
) -> None:
    """Of the rotor beyond a full turn."""
    dataset = run(CONTROLLERS)
    t, decay = dataset.time.values, damping / (2.0 * inertia)
    omega = np.sqrt(stiffness / inertia - decay**2)
    known = target * (1.0 - np.exp(-decay * t) * (np.cos(omega * t) + decay / omega * np.sin(omega * t)))
    # rtol 1e-11 over some hundred steps, of a metre or some radians
    assert dataset.joint_position.sel(coordinate=coordinate).values == pytest.approx(known, abs=1e-8 * target)


def test_the_integral_part_takes_a_disturbance_and_a_ramp_up() -> None:
    dataset = run(CONTROLLERS)
    m, P, I, D, ramp, push = 2.0, 300.0, 900.0, 20.0, 0.2, -5.0
    # x, v, z, t, 1
    A = [
        [0, 1, 0, 0, 0],
        [-P / m, -D / m, 1 / m, P * ramp / m, (D * ramp + push) / m],
        [-I, 0, 0, I * ramp, 0],
        [0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0],
    ]
    known = linear(A, [0.0, 0.0, 0.0, 0.0, 1.0], dataset.time.values)
    assert dataset.joint_position.sel(coordinate="B").values == pytest.approx(known[:, 0], abs=1e-9)
    assert dataset.controller_integral.sel(controller="B").values == pytest.approx(known[:, 2], abs=1e-7)
    given = P * (ramp * known[:, 3] - known[:, 0]) + known[:, 2] + D * (ramp - known[:, 1])
    assert dataset.controller_force.sel(controller="B").values == pytest.approx(given, abs=1e-7)


def test_the_integral_follows_a_limited_force() -> None:
    """At its limit all along, the slide falls away as under 1 N, and the integral part follows that limit."""
    dataset = run(CONTROLLERS)
    m, P, I, D, limit, rate = 2.0, 50.0, 30.0, 10.0, 1.0, 2.0
    t = dataset.time.values
    assert dataset.joint_position.sel(coordinate="C").values == pytest.approx(0.25 * t**2, abs=1e-10)
    assert dataset.controller_force.sel(controller="C").values == pytest.approx(limit, rel=1e-12)
    # z' = I (1 - x) + (limit - P (1 - x) - z + D v)/T with x = limit t^2/(2 m), over z, t^2, t, 1
    a = limit / (2.0 * m)
    A = [
        [-rate, (rate * P - I) * a, rate * D * 2.0 * a, I + rate * (limit - P)],
        [0, 0, 2, 0],
        [0, 0, 0, 1],
        [0, 0, 0, 0],
    ]
    known = linear(A, [0.0, 0.0, 0.0, 1.0], t)[:, 0]
    assert dataset.controller_integral.sel(controller="C").values == pytest.approx(known, abs=1e-8)


def test_a_sampled_controller_holds_its_force_between_samples() -> None:
    dataset = run(CONTROLLERS)
    m, P, I, D, T, low, high, target = 2.0, 200.0, 400.0, 10.0, 0.007, -15.0, 12.0, 0.1
    times, x, v, z, before = [], 0.0, 0.0, 0.0, target
    forces, places = [], []
    for k in range(143):
        error = target - x
        asked = P * error + z + D * (error - before) / T
        force = min(max(asked, low), high)
        z, before = z + T * (I * error + (force - asked) * I / P), error
        times.append(k * T)
        places.append(x)
        forces.append(force)
        x, v = x + v * T + 0.5 * force / m * T**2, v + force / m * T
    assert max(forces) == high
    at = np.searchsorted(dataset.time.values, np.array(times) - 1e-9)
    assert dataset.time.values[at] == pytest.approx(times, abs=1e-12)
    # between samples the motion is a parabola, which the method gets to rounding
    assert dataset.joint_position.sel(coordinate="E").values[at] == pytest.approx(places, abs=1e-11)
    # what is recorded at a sample is what held before it
    assert dataset.controller_force.sel(controller="E").values[at[1:]] == pytest.approx(forces[:-1], abs=1e-9)
    inside = np.searchsorted(times, dataset.time.values - 1e-9) - 1
    assert dataset.controller_force.sel(controller="E").values[1:] == pytest.approx(
        np.array(forces)[inside[1:]], abs=1e-9
    )
    work = float(dataset.load_work[-1])
    assert np.abs(dataset.energy_error.values).max() < 1e-9 * work


# Bushings: coupled plane motion, natural frequencies, torque as the slope of the energy ------------------------------

K = np.array([[2000.0, 300.0, 10.0], [300.0, 1500.0, -20.0], [10.0, -20.0, 4.0]])
C = np.diag([8.0, 6.0, 0.02])
M = np.diag([2.0, 2.0, 0.03])


def closed_form(times: np.ndarray) -> np.ndarray:
    """x, y, angle and their rates; in a plane the equations are linear for any angle."""
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    start = np.array([0.02, -0.01, 1.8, 0.0, 0.5, 0.0])
    return np.array([expm(t * A) @ start for t in times])


def test_a_block_on_a_bushing_moves_as_the_linear_equations_say() -> None:
    dataset = run("checks/bushing")
    known = closed_form(dataset.time.values)
    # rtol 1e-11 over some hundred steps leaves 1e-11 of a metre
    assert dataset.position.values[:, 0, :2] == pytest.approx(known[:, :2], abs=1e-9)
    assert dataset.bushing_displacement.values[:, 0, :2] == pytest.approx(known[:, :2], abs=1e-9)
    assert dataset.bushing_rotation.values[:, 0, 2] == pytest.approx(known[:, 2], abs=1e-8)
    force = -(known[:, :3] @ K + known[:, 3:] @ C)
    # forces err by stiffness and damping times what positions and rates err by: 1e-8 of the largest, ten times and more
    assert dataset.load_force.values[:, 0, :2] == pytest.approx(force[:, :2], abs=1e-6 * np.abs(force).max())
    assert dataset.load_moment.values[:, 0, 2] == pytest.approx(force[:, 2], abs=1e-6 * np.abs(force).max())
    stored = 0.5 * np.einsum("ti,ij,tj->t", known[:, :3], K, known[:, :3])
    assert dataset.elastic.values == pytest.approx(stored, abs=1e-8 * stored.max())
    assert np.abs(dataset.energy_error).max() < 1e-8 * stored.max()


def test_natural_frequencies_of_a_mounted_block() -> None:
    """The undamped ones, of the eigenproblem that the full matrices pose."""
    small = frequencies("checks/bushing", (("load.mount.damping", (0.0,) * 6),))
    out_of_plane = np.array([[1000.0 / 2.0]]), np.linalg.solve(np.diag([0.01, 0.02]), [[5.0, 1.0], [1.0, 6.0]])
    squares = [np.linalg.eigvals(block).real for block in (np.linalg.solve(M, K), *out_of_plane)]
    known = np.sort(np.sqrt(np.concatenate(squares))) / (2.0 * np.pi)
    # central differences with extrapolation reach 1e-9
    assert np.sort(small.frequency.values) == pytest.approx(known, rel=1e-7)


def turning(speed: list[float], stiffness: list[float], end: float, **more: object) -> dict[str, object]:
    """A round body on a bushing at its centre, set turning; SI."""
    mount = {"type": "bushing", "between": ["ground.o", "b.o"], "stiffness": stiffness, **more}
    bodies = {
        "ground": {"type": "ground", "frames": {"o": {}}},
        "b": rigid(1.0, 0.01, {"o": {}}, pose={}, angular_velocity=speed),
    }
    return scene(bodies, {}, end, load={"mount": mount})


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.6, -0.48, 0.64)], ids=["along z", "oblique"])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_bushing_resists_beyond_half_a_turn_as_below(share: float, direction: tuple[float, float, float]) -> None:
    """Alike in all directions it is a torsional spring about any axis: A sin(sqrt(k/J) t), up to a full turn."""
    stiffness, inertia = 2.0, 0.01
    omega, largest = np.sqrt(stiffness / inertia), share * 2.0 * np.pi
    run = simulate(turning([largest * omega * d for d in direction], [1e3] * 3 + [stiffness] * 3, 0.6))
    known = largest * np.sin(omega * run.time.values)
    assert np.abs(known).max() > 0.9 * largest
    # rtol 1e-12 over some hundred steps
    turned = run.bushing_rotation.values[:, 0] @ np.array(direction)
    assert turned == pytest.approx(known, abs=1e-8)
    assert run.load_moment.values[:, 0] @ np.array(direction) == pytest.approx(-stiffness * known, abs=1e-7)
    assert np.abs(run.energy_error).max() < 1e-9 * 0.5 * stiffness * largest**2


def test_energy_is_conserved_while_a_body_passes_half_a_turn_about_changing_axes() -> None:
    """Unequal stiffness moves the axis of rotation: the torque is the slope of one energy on both sides."""
    run = simulate(turning([20.0, 35.0, -30.0], [1e3] * 3 + [2.0, 1.5, 1.0], 1.0))
    size = np.linalg.norm(run.bushing_rotation.values[:, 0], axis=1)
    assert size.max() > 1.1 * np.pi
    # as accurate as rtol 1e-12 keeps a joule
    assert np.abs(run.energy_error).max() < 1e-8


@pytest.mark.parametrize("integrator", [{"rtol": 1e-8}, {"rtol": 1e-3}])
def test_a_bushing_that_comes_to_a_full_turn_ends_the_run_in_words(integrator: dict[str, object]) -> None:
    table = turning([0.0, 0.0, 100.0], [1e3] * 3 + [2.0] * 3, 1.0)
    table["solver"] = integrator
    with pytest.raises(SolverError, match=r"bushing mount has turned by 35\d deg.*joint-spring"):
        simulate(table)


def test_a_bushing_that_does_not_resist_rotation_turns_for_ever() -> None:
    run = simulate(turning([0.0, 0.0, 100.0], [1e3] * 3 + [0.0] * 3, 0.5))
    assert run.angular_velocity.values[:, 0, 2] == pytest.approx(np.full(run.sizes["time"], 100.0), rel=1e-12)
