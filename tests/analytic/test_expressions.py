"""Loads and laws by expressions against closed forms, and against those that they imitate; also with events."""

import re
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.special import beta

from flexclear.dynamics import analyses
from flexclear.dynamics.compile import sources
from flexclear.dynamics.drives.pieces import Pieces, jump, pieces_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import tabulate
from flexclear.scene.laws import Expression, Harmonic, Polynomial, Step
from flexclear.scene.load import edited, load_scene, scene_of
from flexclear.scene.schema import Scene
from flexclear.scene.units import quantity
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, run
from tests.analytic.test_events import GROUND, event_of, require_balanced, simulated
from tests.properties.mechanisms import GRAVITY, Table, body, frame, ground, joint, rigid, scene, simulate

K, MASS, AMPLITUDE = 2e3, 2.0, 0.03


def slide(push: Table, start: float = AMPLITUDE, end: float = 0.2, speed: float = 0.0, **more: Any) -> Table:
    """A mass on a rail along z that a load pushes along the joint 'rail'."""
    bodies = {
        "ground": ground(O=(0, 0, 0)),
        "slide": body((0, 0, start), MASS, {"F": {}}, velocity=[0.0, 0.0, speed]) | {"com": [0, 0, 0]},
    }
    loads = more.pop("load", {}) | {"push": {"type": "joint-expression", "joint": "rail"} | push}
    return scene(bodies, {"rail": joint("prismatic", "ground.O", "slide.F")}, end, load=loads, **more)


def period() -> float:
    """Of a mass between two springs of force k x^1.5, from the energy integral."""
    quarter = np.sqrt(1.25 * MASS / K) * AMPLITUDE**-0.25 * beta(0.4, 0.5) / 2.5
    return float(4.0 * quarter)


def test_the_period_between_two_springs_of_power_one_and_a_half() -> None:
    force = "k * max(0, -slide.position.z)^1.5 - k * max(0, rail.position)^1.5"
    found = simulate(slide({"force": force, "values": {"k": f"{K} N/m^1.5"}}, end=period()))
    last = found.isel(time=-1)
    # rtol 1e-12 over some ten steps, and the kinks of a force that starts as x^1.5
    assert float(last.joint_position[0]) == pytest.approx(AMPLITUDE, rel=1e-9)
    assert float(last.joint_velocity[0]) == pytest.approx(0.0, abs=1e-9)
    # the load's power is work, which the balance of energy has
    assert float(abs(found.load_work).max()) > 0.1
    assert float(abs(found.energy_error).max()) < 1e-11
    assert found.kinetic.values == pytest.approx(found.load_work.values, abs=1e-11)


def test_a_gap_is_crossed_freely_and_its_end_is_a_kink_on_which_steps_end() -> None:
    gap, speed, k = 0.01, 0.5, 5e4
    table = slide(
        {"force": "-k * max(0, rail.position - gap)", "values": {"k": f"{k} N/m", "gap": f"{gap} m"}}, 0.0, 0.06
    )
    table["body"]["slide"]["velocity"] = [0.0, 0.0, speed]
    table["solver"] = {"rtol": 1e-9, "integrator": "dop853"}
    found = simulate(table)
    w = np.sqrt(k / MASS)
    t = found.time.values - gap / speed
    inside = (t > 0.0) & (t < np.pi / w)
    back = gap - speed * (t - np.pi / w)
    known = np.where(t <= 0.0, gap + speed * t, np.where(inside, gap + speed / w * np.sin(w * t), back))
    # rtol of 1e-9 of a mechanism of 0.01 m and of later times; a step across a kink would leave a thousand times more
    assert found.joint_position.values[:, 0] == pytest.approx(known, abs=1e-10)


def pendulum(load: Table, **more: Any) -> Table:
    hinge = {"hinge": joint("revolute", "ground.O", "bob.O")}
    bodies = {"ground": {"type": "ground", "frames": {"O": frame((0, 0, 0), (np.pi / 2, 0, 0))}}}
    bodies["bob"] = body((0.3, 0, 0), 1.0, {"O": frame((-0.3, 0, 0), (np.pi / 2, 0, 0)), "tip": frame((0.1, 0, 0))})
    return scene(bodies, hinge, 1.0, load=GRAVITY | {"one": load}, **more)


#: a built-in load, and the same by an expression
TWINS: dict[str, tuple[Table, Table]] = {
    "joint-spring": (
        {"type": "joint-spring", "joint": "hinge", "stiffness": 3.0, "damping": 0.1, "rest": 0.2},
        {
            "type": "joint-expression",
            "joint": "hinge",
            "force": "-k * (hinge.position - rest) - c * hinge.velocity",
            "values": {"k": "3 N m/rad", "c": "0.1 N m s/rad", "rest": "0.2 rad"},
        },
    ),
    "spring-damper": (
        {
            "type": "spring-damper",
            "between": ["ground.O", "bob.tip"],
            "stiffness": 50.0,
            "damping": 0.5,
            "free_length": 0.35,
        },
        {
            "type": "line-expression",
            "between": ["ground.O", "bob.tip"],
            "force": "50 N/m * (length - free) + 0.5 N s/m * rate",
            "values": {"free": "350 mm"},
        },
    ),
    "point-force": (
        {
            "type": "point-force",
            "frame": "bob.tip",
            "force": [1.0, {"type": "harmonic", "amplitude": 3.0, "frequency": 7.0}, 2.0],
            "axes": "frame",
        },
        {
            "type": "point-expression",
            "frame": "bob.tip",
            "force": ["1 N", "3 N * sin(w * t)", "2 N"],
            "values": {"w": "7 rad/s"},
            "axes": "frame",
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TWINS)
def test_an_expression_does_what_the_load_does_that_it_writes_out(name: str) -> None:
    known, found = (simulate(pendulum(load)) for load in TWINS[name])
    for variable in ("joint_position", "joint_velocity", "load_force", "load_moment", "load_length"):
        # rtol 1e-12, sums in another order; sizes are of order 1 to 10
        assert found[variable].values == pytest.approx(known[variable].values, abs=1e-9), variable
    assert float(abs(found.energy_error).max()) < 1e-10 * float(found.kinetic.max())


def test_vectors_norms_and_distances() -> None:
    """A spring of no length by components, by a vector, and by a distance: one motion."""
    first = {"type": "point-expression", "frame": "bob.tip", "values": {"k": "40 N/m"}}
    vector = simulate(pendulum(first | {"force": "k * (ground.O.position - bob.tip.position)"}))
    parts = [f"k * (ground.O.position.{c} - bob.tip.position.{c})" for c in "xyz"]
    by_parts = simulate(pendulum(first | {"force": parts}))
    distance = "k * norm(bob.tip.position - ground.O.position)"
    line = {"type": "line-expression", "between": ["ground.O", "bob.tip"], "force": distance, "values": {"k": "40 N/m"}}
    along = simulate(pendulum(line))
    for found in (by_parts, along):
        # rtol 1e-12 over a second
        assert found.joint_position.values == pytest.approx(vector.joint_position.values, abs=1e-10)


def test_the_energy_of_every_kind_of_load_by_expression_is_in_the_balance() -> None:
    found = run("checks/expressions")
    # the default tolerance, 1e-10
    assert float(abs(found.energy_error).max()) < 1e-9 * float(found.kinetic.max())
    assert float(abs(found.load_work).max()) > 0.1


def test_the_frequency_about_an_equilibrium_of_a_nonlinear_spring() -> None:
    weight = {"weight": {"type": "gravity", "acceleration": [0.0, 0.0, 9.81]}}
    table = slide({"force": "-k * max(0, rail.position)^1.5", "values": {"k": f"{K} N/m^1.5"}}, load=weight)
    found = analyses.frequencies(Scene.model_validate(table), {}, lambda fraction, text: None)
    rest = (MASS * 9.81 / K) ** (2.0 / 3.0)
    assert float(found.position.sel(body="slide", axis="z")) == pytest.approx(rest, rel=1e-10)
    slope = 1.5 * K * np.sqrt(rest)
    # differences of a smooth force
    assert float(found.frequency[0]) == pytest.approx(np.sqrt(slope / MASS) / (2.0 * np.pi), rel=1e-8)


def test_a_number_of_an_expression_compiles_nothing_anew() -> None:
    first = load_scene(TREE / "scenes/checks/expressions.toml")
    other = edited(first, {"load.ends.values.k": "3 N/mm^1.5", "load.rope.values.l": "0.8 m"})
    structure = edited(first, {"load.ends.force": "-2 * push * rail.position / gap + 0 * k * gap^1.5"})
    models = [tabulate(build(scene, {})) for scene in (first, other)]
    assert models[0].parts == models[1].parts
    assert not np.array_equal(models[0].arrays.f, models[1].arrays.f)
    assert np.array_equal(models[0].arrays.h, models[1].arrays.h)
    assert repr(models[0].parts) in sources.source_of_steps(models[0].parts, ())
    assert tabulate(build(structure, {})).parts != models[0].parts


REFUSED = {
    "-k * rail.velocity": r"its value is in kg m/s\^3|its value is in N/s",
    "k * rail.position + 3": "cannot be added",
    "k * slide.position": "it is a vector",
    "k * slide.acceleration.z": "depends on more than positions and velocities",
    "k * sign(rail.velocity) * 1 m": r"sign\(...\) jumps",
    "k * rail.positon": "did you mean",
    "k * rail.position * q": "there is no quantity 'q'",
    "k * (rail.position": "is not a quantity: write",
    "1 N * t / 1 s": "values.k is not used",
}  # fmt: skip


@pytest.mark.parametrize("force", REFUSED)
def test_what_cannot_be_computed_is_refused_with_place_and_reason(force: str) -> None:
    with pytest.raises((InputError, ValueError), match=REFUSED[force]) as error:
        Scene.model_validate(slide({"force": force, "values": {"k": "2 N/m"}}))
    assert "load.push" in str(error.value)


def law(value: str, dimension: str = "length", **more: Any) -> Pieces:
    values = {"a": "10 mm", "w": "7 rad/s", "b": "1 m/s^3", "T": "0.5 s"}
    used = {name: values[name] for name in values if name in re.findall(r"\w+", value)}
    return pieces_of(Expression(type="expression", value=value, values=used, **more), dimension)


def test_a_sine_that_is_written_out_is_the_built_in_law() -> None:
    known = pieces_of(Harmonic(type="harmonic", amplitude="10 mm", frequency="7 rad/s", phase="0.3 rad"), "length")
    assert law("a * sin(w * t + 0.3 rad)") == known


@pytest.mark.parametrize("degrees", ["30°", "30 °", "30º"])
def test_a_sign_for_degrees_is_a_unit(degrees: str) -> None:
    assert law(f"a * sin(w * t + {degrees})") == law("a * sin(w * t + 30 deg)")
    assert quantity(degrees, "angle") == pytest.approx(np.pi / 6.0, rel=1e-15)
    assert pieces_of(Polynomial(type="polynomial", coefficients=[degrees]), "angle") == law(degrees, "angle")


def test_products_of_sines_and_kinks_have_exact_rates() -> None:
    found = law("a * sin(w * t)^2 * cos(2 * w * t + 0.3 rad) + b * max(0, t - T)^3", end=2)
    assert found.starts == pytest.approx([0.0, 0.5], abs=1e-12)
    for t in (0.1, 0.5, 0.9, 1.7):
        s, c, late = np.sin(7 * t), np.cos(7 * t), max(t - 0.5, 0.0)
        C, S = np.cos(14 * t + 0.3), np.sin(14 * t + 0.3)
        # rounding of sums of a few terms, multiplied by 28^2 in the second rate
        assert found.value(t) == pytest.approx(0.01 * s * s * C + late**3, abs=1e-15)
        rate = 0.01 * (14 * s * c * C - 14 * s * s * S)
        assert found.value(t, 1) == pytest.approx(rate + 3 * late**2, abs=1e-13)
        second = 0.01 * (98 * (c * c - s * s) * C - 392 * s * c * S - 196 * s * s * C)
        assert found.value(t, 2) == pytest.approx(second + 6 * late, abs=1e-12)


def test_kinks_are_located_and_jumps_of_the_rate_are_refused_as_of_any_law() -> None:
    found = law("a * abs(sin(w * t))", end=2)
    assert found.starts[1:] == pytest.approx(np.pi / 7 * np.arange(1, 5), abs=1e-14)
    assert jump(found, 0.0, 2.0) == (found.starts[1], "rate")
    ramp = law("a * min(1, max(0, t / T))^2 * (3 - 2 * min(1, max(0, t / T)))", start=-1, end=2)
    smooth = pieces_of(Step(type="step", start=0.0, end=0.5, change="10 mm"), "length")
    for t in (-0.5, 0.0, 0.1, 0.3, 0.5, 1.0):
        for order in range(3):
            # 0.01 and its rates, up to 0.24
            assert ramp.value(t, order) == pytest.approx(smooth.value(t, order), abs=1e-14)
    assert jump(ramp, -1.0, 2.0) is None
    assert law("a * step(t - T)", end=2).value(0.6) == 0.01


NO_LAWS = {
    "a * exp(t / T)": "cannot be written in polynomials and sines",
    "a * t": "but a length",
    "a * sin(w * t^2 / T)": "an angle linear in t",
    "a * t * sin(w * t) / T": "a sine times the time",
    "a * T / t": "a divisor that changes",
    "a * abs(sin(w * t))": "need an `end`",
    "a * sin(slide.position.z)": "there is no quantity 'slide.position.z'",
    "a * (t / T)^8": "at most the degree 7",
}


@pytest.mark.parametrize("value", NO_LAWS)
def test_what_is_no_law_is_refused(value: str) -> None:
    with pytest.raises(ValueError, match=NO_LAWS[value]):
        law(value)


def test_a_driven_slide_follows_an_expression() -> None:
    """A cycloidal rise in 0.2 s, and the force that its acceleration needs."""
    rise = {"type": "expression", "value": "h * (t / T - sin(2 * pi * t / T) / (2 * pi))"}
    drive = {"cam": {"joint": "rail", "law": rise | {"values": {"h": "30 mm", "T": "0.2 s"}}}}
    table = slide({"force": "0 * t * F / T", "values": {"F": "1 N", "T": "1 s"}}, 0.0, drive=drive)
    found = simulate(table)
    w = 10.0 * np.pi
    t = found.time.values
    assert found.joint_position.values[:, 0] == pytest.approx(0.03 * (t / 0.2 - np.sin(w * t) / (2 * np.pi)), abs=1e-15)
    # m times the second rate; 1e-16 of 30 N
    assert found.drive_force.values[:, 0] == pytest.approx(MASS * 0.03 / 0.2 * w * np.sin(w * t), abs=1e-12)


# Events. Runs are at rtol 1e-12; what is compared is of order 1 to 10, and is right to 1e-11 -------------------------

INERTIA = 0.5
NONE = {"type": "joint-force", "joint": "axle", "force": 0.0}
WINDING = {
    "type": "joint-expression",
    "joint": "axle",
    "force": "-k * axle.position",
    "values": {"k": "2 N m/rad"},
}


def scene_with(load: dict[str, Any], speed: float | None = None) -> dict[str, Any]:
    """A wheel of 0.5 kg m^2 on an axle along z."""
    turning = {} if speed is None else {"angular_velocity": [0.0, 0.0, speed]}
    wheel = rigid(1.0, INERTIA, {"A": {}, "rim": frame([0.1, 0.0, 0.0])}, pose={}, **turning)
    axle = {"axle": joint("revolute", "ground.O", "wheel.A")}
    return {"body": {"ground": GROUND, "wheel": wheel}, "joint": axle, "load": load}


def wheel(event: dict[str, Any], speed: float | None = 0.0, load: Any = None, **more: Any) -> xr.Dataset:
    return simulated(event, 1.0, **scene_with(load or {}, speed), **more)


def test_a_block_on_a_nonlinear_spring_is_held_and_let_go() -> None:
    """Force -k x^3 from 0.1 m: what is stored stays over the lock, and the motion after it starts from rest."""
    spring = {
        "type": "joint-expression",
        "joint": "slide",
        "force": "-k * (slide.position + a)^3",
        "values": {"k": "5000 N/m^3", "a": "0.1 m"},
    }
    block = {"type": "rigid", "mass": 2.0, "inertia": [1.0] * 3, "pose": {}, "frames": {"B": {}}}
    event = {"hold": {"at": 0.3, "lock": "joint.slide"}, "go": {"at": 0.5, "release": "event.hold"}}
    joint = {"slide": {"type": "prismatic", "between": ["ground.O", "block.B"]}}
    run = simulated(event, 1.0, body={"ground": GROUND, "block": block}, joint=joint, load={"spring": spring})

    def motion(start: list[float], duration: float) -> np.ndarray:
        def rates(t: float, y: np.ndarray) -> list[float]:
            return [y[1], -2500.0 * y[0] ** 3]

        return np.asarray(solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1])

    held = motion([0.1, 0.0], 0.3)
    end = motion([held[0], 0.0], 0.5)
    assert float(event_of(run, "hold").event_energy_loss) == pytest.approx(held[1] ** 2, rel=1e-10)
    assert run.position.values[-1, 0, 2] + 0.1 == pytest.approx(end[0], abs=1e-11)
    assert run.velocity.values[-1, 0, 2] == pytest.approx(end[1], abs=1e-11)
    force = run.drive_force.sel(drive="hold", time=0.4, method="nearest")
    assert float(force) == pytest.approx(5000.0 * held[0] ** 3, rel=1e-10)
    require_balanced(run, 0.125)


@pytest.mark.parametrize("at", ["axle.position > 8 rad", "0.7 s"])
def test_an_expression_reads_the_turns_of_earlier_phases(at: str) -> None:
    """The wheel winds a spring of 2 N m/rad by 15 rad: an event that changes nothing leaves the sine that it is."""
    run = wheel({"nothing": {"at": at, "release": "load.none"}}, 30.0, {"winding": WINDING, "none": NONE})
    assert np.abs(run.joint_position.values[:, 0] - 15.0 * np.sin(2.0 * run.time.values)).max() < 1e-9
    require_balanced(run, 225.0)


@pytest.mark.parametrize("to", [WINDING, {"type": "joint-spring", "joint": "axle", "stiffness": 2.0}])
def test_a_load_that_an_event_brings_in_counts_the_turns_before_it(to: dict[str, Any]) -> None:
    run = wheel({"on": {"at": "0.7 s", "switch": "load.none", "to": to}}, 20.0, {"none": NONE})
    assert run.joint_position.values[-1, 0] == pytest.approx(14.0 * np.cos(0.6) + 10.0 * np.sin(0.6), rel=1e-10)
    if to["type"] == "joint-spring":  # what an expression does is work of a load, and none at the event
        assert float(event_of(run, "on").event_energy_loss) == pytest.approx(-(14.0**2), rel=1e-10)
    require_balanced(run, 225.0)


def test_an_expression_of_a_switch_counts_time_from_it_and_any_other_from_the_start() -> None:
    """3 N m/s (t - 0.4 s) from 0.4 s on; -3 N m/s t over the whole run."""
    ramp = {"type": "joint-expression", "joint": "axle", "force": "c * t", "values": {"c": "-3 N m/s"}}
    on = {"type": "joint-expression", "joint": "axle", "force": "c*t", "values": {"c": "3 N m/s"}}
    run = wheel({"on": {"at": 0.4, "switch": "load.none", "to": on}}, 0.0, {"none": NONE, "ramp": ramp})
    assert run.angular_velocity.values[-1, 0, 2] == pytest.approx((1.5 * 0.36 - 1.5) / INERTIA, rel=1e-10)
    require_balanced(run, 1.0)


def test_a_crank_driven_by_an_expression_is_let_go_at_a_torque() -> None:
    """(1 - cos 10 t)/2 rad: the torque is 25 cos 10 t N m; from -10 N m on the wheel goes on evenly."""
    law = {"type": "expression", "value": "a * sin(w * t)^2", "values": {"a": "1 rad", "w": "5 rad/s"}}
    off = {"off": {"at": "motor.force < -10 N m", "release": "drive.motor"}}
    run = wheel(off, None, drive={"motor": {"joint": "axle", "law": law}})
    t = np.arccos(-0.4) / 10.0
    assert float(event_of(run, "off").event_time) == pytest.approx(t, abs=1e-11)
    end = 0.5 * (1.0 - np.cos(10.0 * t)) + 5.0 * np.sin(10.0 * t) * (1.0 - t)
    assert run.joint_position.values[-1, 0] == pytest.approx(end, rel=1e-11)
    require_balanced(run, 6.0)


def test_a_drive_is_switched_to_an_expression_with_a_kink() -> None:
    law = {"type": "polynomial", "coefficients": [0.0, 2.0]}
    values = {"a": "1 rad/s", "b": "3 rad/s^2", "T": "0.2 s"}
    new = {"type": "expression", "value": "a * t + b * max(0, t - T)^2", "values": values, "end": 1.0}
    event = {"sw": {"at": "0.3 s", "switch": "drive.motor", "to": {"law": new}}}
    run = wheel(event, None, drive={"motor": {"joint": "axle", "law": law}})
    t = run.time.values
    known = np.where(t < 0.3, 2.0 * t, 0.3 + t + 3.0 * np.maximum(0.0, t - 0.5) ** 2)
    assert np.abs(run.joint_position.values[:, 0] - known).max() < 1e-12
    assert float(event_of(run, "sw").event_impulse) == pytest.approx(-INERTIA, rel=1e-10)
    require_balanced(run, 4.0)


def test_a_load_that_reads_a_joint_goes_with_it() -> None:
    """The force on the rim, -k times the angle, ceases with the axle: the wheel flies on evenly."""
    force = {"type": "point-expression", "frame": "wheel.rim", "values": {"k": "2 N/rad"}}
    load = {"force": force | {"force": ["-k * axle.position", "0 N", "0 N"]}}
    run = wheel({"break": {"at": "0.3 s", "release": "joint.axle"}}, 3.0, load)
    after = run.time.values >= 0.3
    assert np.ptp(run.angular_velocity.values[after, 0, 2]) < 1e-12
    assert not run.load_force.values[after].any()
    require_balanced(run, 2.25)


REFUSED_OF_SWITCHES = {
    "there is no quantity 'foo.position'": {"force": "c * foo.position"},
    r"its value is in N, but a torque \[N m\]": {"force": "c * t", "values": {"c": "3 N/s"}},
    "values.k is not used": {"force": "2 N m", "values": {"k": 1}},
}


@pytest.mark.parametrize("words", REFUSED_OF_SWITCHES)
def test_an_expression_of_a_switch_is_checked_with_the_scene(words: str) -> None:
    ramp = {"type": "joint-expression", "joint": "axle", "force": "c * t", "values": {"c": "-3 N m/s"}}
    event = {"on": {"at": 0.5, "switch": "load.p", "to": REFUSED_OF_SWITCHES[words]}}
    with pytest.raises(InputError, match=r"\[event.on.to\]: .*" + words):
        scene_of({"title": "t", "time": {"end": 1.0}, "event": event, **scene_with({"p": ramp})})
