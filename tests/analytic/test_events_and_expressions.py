"""Events in scenes with loads, laws and references by expressions, against closed forms.

Runs are at rtol 1e-12; what is compared is of order 1 to 10, and differs from closed forms by less than 1e-11.
"""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from flexclear.pipeline.core.scene.load import scene_of
from flexclear.pipeline.core.system.errors import InputError
from tests.analytic.test_events import GROUND, event_of, require_balanced, simulated
from tests.properties.mechanisms import frame, joint, rigid

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


def test_a_brake_on_a_wheel_that_an_expression_of_time_drives_slips() -> None:
    """2 N m sin 6 t, held from 0.2 s on until that is 1.8 N m."""
    push = {"type": "joint-expression", "joint": "axle", "force": "a * sin(w * t)"}
    load = {"push": push | {"values": {"a": "2 N m", "w": "6 rad/s"}}}
    event = {
        "hold": {"at": "0.15 s", "lock": "joint.axle"},
        "slip": {"at": "hold.force < -1.8 N m", "release": "event.hold"},
    }
    run = wheel(event, load=load)
    t = np.arcsin(0.9) / 6.0
    assert float(event_of(run, "slip").event_time) == pytest.approx(t, abs=1e-11)

    def angle(at: float) -> float:
        return 4.0 * (at / 6.0 - np.sin(6.0 * at) / 36.0)

    after = angle(1.0) - angle(t) - 4.0 / 6.0 * (1.0 - np.cos(6.0 * t)) * (1.0 - t)
    assert run.joint_position.values[-1, 0] == pytest.approx(angle(0.15) + after, abs=1e-11)
    require_balanced(run, 1.0)


def test_a_load_that_reads_a_joint_goes_with_it() -> None:
    """The force on the rim, -k times the angle, ceases with the axle: the wheel flies on evenly."""
    force = {"type": "point-expression", "frame": "wheel.rim", "values": {"k": "2 N/rad"}}
    load = {"force": force | {"force": ["-k * axle.position", "0 N", "0 N"]}}
    run = wheel({"break": {"at": "0.3 s", "release": "joint.axle"}}, 3.0, load)
    after = run.time.values >= 0.3
    assert np.ptp(run.angular_velocity.values[after, 0, 2]) < 1e-12
    assert not run.load_force.values[after].any()
    require_balanced(run, 2.25)


REFUSED = {
    "there is no quantity 'foo.position'": {"force": "c * foo.position"},
    r"its value is in N, but a torque \[N m\]": {"force": "c * t", "values": {"c": "3 N/s"}},
    "values.k is not used": {"force": "2 N m", "values": {"k": 1}},
}


@pytest.mark.parametrize("words", REFUSED)
def test_an_expression_of_a_switch_is_checked_with_the_scene(words: str) -> None:
    ramp = {"type": "joint-expression", "joint": "axle", "force": "c * t", "values": {"c": "-3 N m/s"}}
    event = {"on": {"at": 0.5, "switch": "load.p", "to": REFUSED[words]}}
    with pytest.raises(InputError, match=r"\[event.on.to\]: .*" + words):
        scene_of({"title": "t", "time": {"end": 1.0}, "event": event, **scene_with({"p": ramp})})
