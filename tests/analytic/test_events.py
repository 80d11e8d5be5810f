"""Releases, locks and switches against closed forms; what no event changes goes on as if there were none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import quad

from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.dynamics.record.point import Runner
from flexclear.scene.load import edited, load_scene, scene_of
from flexclear.scene.quantity import parse_recorded
from flexclear.scene.schema import Scene
from flexclear.stages import simulation
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from tests.properties import mechanisms
from tests.properties.mechanisms import joint, rigid

TREE = Path(__file__).resolve().parents[2]
G, GROUND = 9.81, {"type": "ground", "frames": {"O": {}}}
GRAVITY = {"type": "gravity", "acceleration": [0.0, -G, 0.0]}
#: a wheel of 0.5 kg m^2 on an axle along z
WHEEL: dict[str, Any] = {
    "body": {"ground": GROUND, "wheel": rigid(1.0, 0.5, {"A": {}}, pose={})},
    "joint": {"axle": joint("revolute", "ground.O", "wheel.A")},
}


def simulated(event: dict[str, Any], end: float, **parts: Any) -> xr.Dataset:
    table = {
        "title": "events",
        "time": {"end": end},
        "solver": {"integrator": "dop853", "rtol": 1e-12},
        "output": {"interval": end / 100},
        "event": event,
        **parts,
    }
    return mechanisms.simulated(scene_of(table))


def pendulum(event: dict[str, Any], end: float = 1.0, **more: Any) -> xr.Dataset:
    """A mass of 1 kg with 0.2 kg m^2, its centre 1 m from a hinge, released from the horizontal."""
    bob = rigid(1.0, 0.2, {"H": {}}, com=[-1.0, 0.0, 0.0], pose={})
    hinge = {"hinge": joint("revolute", "ground.O", "bob.H")}
    return simulated(event, end, body={"ground": GROUND, "bob": bob}, joint=hinge, load={"g": GRAVITY}, **more)


def slope(angle: float) -> float:
    """Rate of that pendulum's angle below the horizontal [rad/s]."""
    return float(np.sqrt(2.0 * G * np.sin(angle) / 1.2))


def angle_of(force: float) -> float:
    """Where the reaction is that large [rad]: (1 + 2/1.2) m g sin along the arm, m g cos (1 - 1/1.2) across it."""
    along, across = (1.0 + 2.0 / 1.2) ** 2, (1.0 - 1.0 / 1.2) ** 2
    return float(np.arcsin(np.sqrt(((force / G) ** 2 - across) / (along - across))))


def time_to(angle: float) -> float:
    """When it is there: the integral of 1/rate, with the root of the angle as variable."""
    return float(quad(lambda s: 2.0 * s / slope(s * s), 0.0, np.sqrt(angle), epsabs=1e-13, epsrel=1e-13)[0])


def event_of(run: xr.Dataset, name: str) -> xr.Dataset:
    return run.isel(event=run["event_contact"].values.tolist().index(name))


def require_balanced(run: xr.Dataset, scale: float) -> None:
    """Errors of the ledger are those of an integration at rtol 1e-12; measured below 1e-11 of the energies."""
    assert np.abs(run["energy_error"].values).max() < 1e-9 * scale


@pytest.mark.parametrize("at", ["0.3 s", "hinge.position > 60 deg"])
def test_a_released_pendulum_is_a_projectile(at: str) -> None:
    run = pendulum({"break": {"at": at, "release": "joint.hinge"}})
    t = float(event_of(run, "break").event_time)
    expected = 0.3 if at == "0.3 s" else time_to(np.radians(60.0))
    assert t == pytest.approx(expected, abs=1e-10)  # rtol 1e-12 leaves some 1e-12 s
    k = run["time"].values.tolist().index(t)
    since = run["time"].values[k:] - t
    p, v = run["position"].values[k, 0], run["velocity"].values[k, 0]
    flight = p + v * since[:, None] + 0.5 * np.array([0.0, -G, 0.0]) * since[:, None] ** 2
    assert np.abs(run["position"].values[k:, 0] - flight).max() < 1e-11
    angle = np.arctan2(-p[1], -p[0])
    assert np.linalg.norm(v) == pytest.approx(slope(angle), rel=1e-10)
    assert np.abs(run["joint_force"].values[k:]).max() < 1e-12
    assert np.isnan(run["joint_position"].values[k:]).all()
    assert np.isfinite(run["joint_position"].values[:k]).all()
    require_balanced(run, G)


def test_the_state_before_an_event_is_a_row() -> None:
    run = pendulum({"break": {"at": "force(hinge) > 20 N", "release": "joint.hinge"}})
    t = float(event_of(run, "break").event_time)
    before = int(np.searchsorted(run["time"].values, t)) - 1
    assert run["time"].values[before] == np.nextafter(t, 0.0)
    assert np.all(np.diff(run["time"].values) > 0.0)
    assert np.linalg.norm(run["joint_force"].values[before, 0]) == pytest.approx(20.0, rel=1e-9)
    assert t == pytest.approx(time_to(angle_of(20.0)), abs=1e-9)


def test_a_force_that_is_exceeded_between_two_outputs_only() -> None:
    """The largest reaction, at the bottom, is 26.16 N: it is above 26.1599 N for half a millisecond."""
    event = {"break": {"at": "force(hinge) > 26.15999 N", "release": "joint.hinge"}}
    run = pendulum(event, end=1.0, output={"interval": 0.11})
    expected = time_to(angle_of(26.15999))
    assert float(event_of(run, "break").event_time) == pytest.approx(expected, abs=1e-9)


def test_a_condition_that_jumps_where_a_law_does() -> None:
    push = {"type": "joint-force", "joint": "slide", "force": {"type": "piecewise", "sections": [
        {"start": 0.0, "law": 1.0}, {"start": 0.123, "law": 5.0}]}}  # fmt: skip
    run = block({"off": {"at": "push.force > 3 N", "release": "load.push"}}, push)
    assert float(event_of(run, "off").event_time) == pytest.approx(0.123, abs=1e-12)
    assert run["velocity"].values[-1, 0, 2] == pytest.approx(1.0 * 0.123 / 2.0, rel=1e-10)


def block(event: dict[str, Any], push: dict[str, Any] | None = None, **spring: float) -> xr.Dataset:
    """A block of 2 kg that slides along z, with a load along its joint or on a spring, from 0.1 m beyond its rest."""
    bodies = {"ground": GROUND, "block": rigid(2.0, 1.0, {"B": {}}, pose={})}
    slide = {"slide": joint("prismatic", "ground.O", "block.B")}
    pull = {"type": "joint-spring", "joint": "slide", "stiffness": 50.0, "rest": -0.1, **spring}
    load = {"push": push} if push else {"spring": pull}
    return simulated(event, 1.0, body=bodies, joint=slide, load=load)


def test_a_spring_that_is_unhooked() -> None:
    """Up to then x = 0.1 cos(5 t) - 0.1; the block goes on, and the spring takes what it has stored."""
    run = block({"unhook": {"at": 0.2, "release": "load.spring"}})
    v = -0.5 * np.sin(1.0)
    assert run["velocity"].values[-1, 0, 2] == pytest.approx(v, rel=1e-10)
    assert float(event_of(run, "unhook").event_energy_loss) == pytest.approx(25.0 * 0.01 * np.cos(1.0) ** 2, rel=1e-10)
    assert run["position"].values[-1, 0, 2] == pytest.approx(0.1 * np.cos(1.0) - 0.1 + 0.8 * v, rel=1e-10)
    assert not run["load_force"].values[-1].any()
    require_balanced(run, 0.25)


def test_a_spring_that_becomes_stiffer() -> None:
    run = block({"stiffer": {"at": 0.2, "switch": "load.spring", "to": {"stiffness": 200.0}}})
    x, v = 0.1 * np.cos(1.0), -0.5 * np.sin(1.0)
    after = x * np.cos(8.0) + 0.1 * v * np.sin(8.0) - 0.1  # 10 rad/s for 0.8 s
    assert run["position"].values[-1, 0, 2] == pytest.approx(after, rel=1e-9)
    # 75 N/m more at this stretch: energy that the event brings in
    assert float(event_of(run, "stiffer").event_energy_loss) == pytest.approx(-0.5 * 150.0 * x * x, rel=1e-10)
    require_balanced(run, 1.0)


def test_laws_of_a_switched_load_count_from_the_event() -> None:
    ramp = {"force": {"type": "polynomial", "coefficients": [0.0, 4.0]}}
    push = {"type": "joint-force", "joint": "slide", "force": 0.0}
    run = block({"on": {"at": 0.5, "switch": "load.push", "to": ramp}}, push)
    assert run["velocity"].values[-1, 0, 2] == pytest.approx(0.5 * 4.0 * 0.25 / 2.0, rel=1e-10)


def disks(event: dict[str, Any], **more: Any) -> xr.Dataset:
    """A disk of 0.3 kg m^2 that turns at 40 rad/s about z, and one of 0.2 kg m^2 on it at rest, the clutch between."""
    bodies = {
        "ground": GROUND,
        "one": rigid(1.0, 0.3, {"A": {}}, pose={}, angular_velocity=[0.0, 0.0, 40.0]),
        "two": rigid(1.0, 0.2, {"A": {}}, pose={}, angular_velocity=[0.0, 0.0, 0.0]),
    }
    joints = {"bearing": joint("revolute", "ground.O", "one.A"), "clutch": joint("revolute", "one.A", "two.A")}
    return simulated(event, 1.0, body=bodies, joint=joints, **more)


def test_a_clutch_that_engages_and_opens_again() -> None:
    slipping = {"type": "joint-friction", "joint": "clutch", "viscous": 0.05}
    event = {
        "engage": {"at": "clutch.position < -300 deg", "lock": "joint.clutch"},
        "open": {"at": 0.8, "release": "event.engage"},
    }
    run = disks(event, load={"oil": slipping})
    # the relative speed decays as exp(-0.05 t/I), I = 0.12 kg m^2, and the relative angle is -40 I/0.05 (1 - exp(...))
    rate = 0.05 / 0.12
    t = -np.log(1.0 - np.radians(300.0) * rate / 40.0) / rate
    relative = 40.0 * np.exp(-rate * t)
    engage = event_of(run, "engage")
    assert float(engage.event_time) == pytest.approx(t, abs=1e-11)
    assert float(engage.event_energy_loss) == pytest.approx(0.5 * 0.12 * relative**2, rel=1e-10)
    assert abs(float(engage.event_impulse)) == pytest.approx(0.12 * relative, rel=1e-10)
    spin = run["angular_velocity"].values[:, :, 2]
    momentum = spin @ np.array([0.3, 0.2])
    assert np.abs(momentum / 12.0 - 1.0).max() < 1e-11
    locked = run["time"].values >= float(engage.event_time)
    assert np.abs(spin[locked] - 24.0).max() < 1e-10
    held = run["joint_position"].sel(coordinate="clutch").values[locked]
    assert np.abs(held + np.radians(300.0)).max() < 1e-10
    assert float(event_of(run, "open").event_energy_loss) == pytest.approx(0.0, abs=1e-12)
    require_balanced(run, 240.0)


def test_a_torque_that_the_brake_does_not_hold() -> None:
    """The recorded torque of a lock may release it: 3 t N m on a locked wheel of 0.5 kg m^2 that holds 1.2 N m."""
    motor = {"type": "joint-force", "joint": "axle", "force": {"type": "polynomial", "coefficients": [0.0, 3.0]}}
    event = {
        "brake": {"at": 0.1, "lock": "joint.axle"},
        "slip": {"at": "brake.force < -1.2 N m", "release": "event.brake"},
    }
    run = simulated(event, 1.0, **WHEEL, load={"motor": motor})
    assert float(event_of(run, "slip").event_time) == pytest.approx(0.4, abs=1e-11)
    assert float(event_of(run, "brake").event_impulse) == pytest.approx(-0.015, rel=1e-10)
    assert run["angular_velocity"].values[-1, 0, 2] == pytest.approx(1.5 * (1.0 - 0.16) / 0.5, rel=1e-10)
    assert run["drive_force"].sel(drive="brake").values[0] == 0.0
    require_balanced(run, 5.0)


def test_a_drive_that_is_switched_lets_go_and_is_locked() -> None:
    """The motor's new speed takes the impulse I (w2 - w1) at once; ideal drives bring in w2 times that."""
    faster = {"law": {"type": "polynomial", "coefficients": [0.0, 10.0, -2.0]}}
    event = {
        "faster": {"at": "axle.position > 1.2 rad", "switch": "drive.motor", "to": faster},
        "off": {"at": "0.6 s", "release": "drive.motor"},
        "stop": {"at": "0.8 s", "lock": "joint.axle"},
    }
    run = simulated(
        event,
        1.0,
        **WHEEL,
        drive={"motor": {"joint": "axle", "law": {"type": "polynomial", "coefficients": [0.0, 4.0]}}},
    )
    change = event_of(run, "faster")
    assert float(change.event_time) == pytest.approx(0.3, abs=1e-12)
    assert float(change.event_impulse) == pytest.approx(3.0, rel=1e-10)
    assert float(change.event_energy_loss) == pytest.approx(0.5 * 0.5 * 36.0, rel=1e-10)
    at_end = 10.0 - 4.0 * 0.3
    assert float(event_of(run, "stop").event_energy_loss) == pytest.approx(0.25 * at_end**2, rel=1e-10)
    angle = 1.2 + 3.0 - 2.0 * 0.09 + at_end * 0.2
    assert run["joint_position"].values[-1, 0] == pytest.approx(angle, rel=1e-10)
    assert np.isnan(run["drive_position"].sel(drive="motor").values[-1])
    require_balanced(run, 25.0)


def test_a_lock_stops_what_has_much_and_what_has_little_inertia() -> None:
    """Of a thin needle of 5 kg m/s and 1e-10 kg m^2, the translation and the spin: as many joules as it had."""
    needle = rigid(
        5.0, [1e-2, 1e-2, 1e-10], {"A": {}}, pose={}, velocity=[0.0, 0.0, 2.0], angular_velocity=[0, 0, 30.0]
    )
    parts = {
        "body": {"ground": GROUND, "needle": needle},
        "joint": {"eye": joint("cylindrical", "ground.O", "needle.A")},
    }
    run = simulated({"grip": {"at": 0.5, "lock": "joint.eye"}}, 1.0, **parts)
    k = run["time"].values.tolist().index(0.5)
    assert np.abs(run["velocity"].values[k + 1 :]).max() < 1e-12
    assert np.abs(run["angular_velocity"].values[k + 1 :]).max() < 1e-10
    energy = 0.5 * (5.0 * 2.0**2 + 1e-10 * 30.0**2)
    assert float(event_of(run, "grip").event_energy_loss) == pytest.approx(energy, rel=1e-12)


def test_a_lock_of_coordinates_that_depend_on_each_other_stops_them_all() -> None:
    """A plate on a hinge that also slides on a plane: its displacements there are those of its one rotation."""
    far = {"position": [0.6, 0.3, 0.0]}
    plate = rigid(2.0, 0.4, {"O": {}, "far": far}, pose={}, angular_velocity=[0.0, 0.0, 3.0])
    joints = {"hinge": joint("revolute", "ground.O", "plate.O"), "table": joint("planar", "ground.far", "plate.far")}
    bodies = {"ground": {"type": "ground", "frames": {"O": {}, "far": far}}, "plate": plate}
    run = simulated({"grip": {"at": 0.2, "lock": "joint.table"}}, 0.5, body=bodies, joint=joints)
    k = run["time"].values.tolist().index(0.2)
    assert run["angular_velocity"].values[k - 1, 0, 2] == pytest.approx(3.0, rel=1e-12)
    assert np.abs(run["angular_velocity"].values[k + 1 :]).max() < 1e-12
    assert float(event_of(run, "grip").event_energy_loss) == pytest.approx(0.5 * 0.4 * 9.0, rel=1e-12)


def slider_crank(event: dict[str, Any], guide: str = "prismatic", **more: Any) -> xr.Dataset:
    """A crank of 1 m at 5 rad/s, a rod of 2 m and a slider, from the pose with the crank upright."""
    lean = float(np.arcsin(0.5))
    rod = {"position": [float(np.cos(lean)), 0.5, 0.0], "rotation_vector": [0.0, 0.0, -lean]}
    upright = {"position": [0.0, 0.5, 0.0], "rotation_vector": [0.0, 0.0, float(np.pi / 2)]}
    along = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}

    def ends(reach: float) -> dict[str, Any]:
        return {"A": {"position": [-reach, 0.0, 0.0]}, "B": {"position": [reach, 0.0, 0.0]}}

    bodies = {
        "ground": {"type": "ground", "frames": {"O": {}, "G": along}},
        "crank": rigid(1.0, 0.1, ends(0.5), pose=upright, angular_velocity=[0.0, 0.0, 5.0]),
        "rod": rigid(2.0, 0.1, ends(1.0), pose=rod),
        "slider": rigid(3.0, 0.1, {"P": {}, "S": along}, pose={"position": [2.0 * float(np.cos(lean)), 0.0, 0.0]}),
    }
    joints = {
        "main": joint("revolute", "ground.O", "crank.A"), "pin": joint("revolute", "crank.B", "rod.A"),
        "wrist": joint("revolute", "rod.B", "slider.P"), "guide": joint(guide, "ground.G", "slider.S"),
    }  # fmt: skip
    return simulated(event, 1.0, body=bodies, joint=joints, load={"g": GRAVITY}, **more)


@pytest.mark.parametrize("guide", ["prismatic", "cylindrical"])
def test_a_lock_in_a_loop_takes_all_kinetic_energy(guide: str) -> None:
    """One free motion: with the slider held nothing moves, and the impulse on it stops what its speed stands for.

    A cylindrical guide has a rotation as well, which the loop prevents already: rounding is left of its rate."""
    run = slider_crank({"latch": {"at": "slider.position.x < 1.2 m", "lock": "joint.guide"}}, guide)
    latch = event_of(run, "latch")
    k = run["time"].values.tolist().index(float(latch.event_time))
    assert run["position"].sel(body="slider").values[k, 0] == pytest.approx(1.2, abs=1e-10)
    kinetic, v = run["kinetic"].values[k - 1], run["velocity"].sel(body="slider").values[k - 1, 0]
    assert float(latch.event_energy_loss) == pytest.approx(kinetic, rel=1e-10)
    # 2 T = v P with the generalised momentum P of the slider's coordinate; of several coordinates none is recorded
    assert np.isnan(float(latch.event_impulse)) == (guide == "cylindrical")
    assert guide == "cylindrical" or float(latch.event_impulse) == pytest.approx(-2.0 * kinetic / v, rel=1e-9)
    assert np.abs(run["velocity"].values[k:]).max() < 1e-10
    require_balanced(run, 50.0)


def test_a_joint_of_a_loop_that_breaks() -> None:
    """Without the wrist pin the slider goes on evenly, and the rest keeps its energy."""
    run = slider_crank({"shear": {"at": "main.position > 120 deg", "release": "joint.wrist"}})
    k = run["time"].values.tolist().index(float(event_of(run, "shear").event_time))
    slide = run["velocity"].sel(body="slider").values[k:, 0]
    assert np.ptp(slide) < 1e-11
    assert not np.isfinite(run["joint_position"].sel(coordinate="wrist").values[k:]).any()
    require_balanced(run, 50.0)


def test_events_after_each_other() -> None:
    """`after` lets a condition that is true from the start on count later; both happen at once then."""
    event = {
        "slow": {"at": "0.3 s", "switch": "load.g", "to": {"acceleration": [0.0, -1.0, 0.0]}},
        "break": {"at": "bob.velocity.y < 1 m/s", "after": "slow", "release": "joint.hinge"},
    }
    run = pendulum(event)
    times = [float(event_of(run, name).event_time) for name in ("slow", "break")]
    assert times == [0.3, 0.3]
    assert run["acceleration"].values[-1, 0, 1] == pytest.approx(-1.0, rel=1e-12)
    require_balanced(run, G)


def test_an_event_that_does_not_happen_is_reported() -> None:
    run = pendulum({"break": {"at": "force(hinge) > 27 N", "release": "joint.hinge"}})
    assert "break did not happen" in run.attrs["warnings"]
    assert "event" not in run.sizes or run.sizes["event"] == 0


def test_what_an_event_leaves_goes_on() -> None:
    """A stop that is closed, turns beyond a full one, a controller's integral: as without the event that changes none.

    Both runs are at rtol 1e-12, and 40 impacts magnify the difference: measured 2e-11.
    """
    normal = {"law": "hertz", "exponent": 1, "stiffness": 2e3}
    parts: dict[str, Any] = {
        "stop": {"end": {"joint": "bearing", "upper": 9.0, "normal": normal}},
        "load": {
            "pid": {"type": "pid", "joint": "clutch", "reference": 7.5, "proportional": 5.0, "integral": 9.0,
                    "derivative": 0.2},
            "spring": {"type": "joint-spring", "joint": "bearing", "stiffness": 2.0},
            "none": {"type": "joint-force", "joint": "bearing", "force": 0.0},
        },
    }  # fmt: skip
    whole = disks({}, **parts)
    inside = "bearing.position > 9.05 rad"
    run = disks({"nothing": {"at": inside, "release": "load.none"}}, **parts)
    assert "end.upper" in run["contact"].values
    t = float(event_of(run, "nothing").event_time)
    assert run["contact_normal_force"].sel(time=t).values[0] > 10.0
    both = np.isin(run["time"].values, whole["time"].values)
    same = np.isin(whole["time"].values, run["time"].values)
    for name in ("joint_position", "angular_velocity"):
        a, b = run[name].values[both], whole[name].values[same]
        assert np.abs(a - b).max() < 1e-9 * np.abs(b).max()
    closings = [d["event_duration"].values[d["event_kind"].values == "closing"] for d in (run, whole)]
    assert closings[0] == pytest.approx(closings[1], rel=1e-8, nan_ok=True)


REFUSED = {
    "is already true": {"at": "force(hinge) > -1 N", "release": "joint.hinge"},
    "there is no joint 'hing'": {"at": 0.1, "release": "joint.hing"},
    "is not a comparison": {"at": "1 < hinge.position < 2", "release": "joint.hinge"},
    "N and m cannot be compared": {"at": "force(hinge) > 2 m", "release": "joint.hinge"},
    "there is no quantity 'hinge.forse'": {"at": "hinge.forse > 2 N", "release": "joint.hinge"},
    "is not within the run": {"at": "2 s", "release": "joint.hinge"},
    "there is no event 'other'": {"at": 0.1, "after": "other", "release": "joint.hinge"},
    "wait for each other": {"at": 0.1, "after": "e", "release": "joint.hinge"},
    "one of release, lock, switch": {"at": 0.1, "release": "joint.hinge", "lock": "joint.hinge"},
    "switch needs to": {"at": 0.1, "switch": "load.g"},
    "names joint.NAME": {"at": 0.1, "lock": "load.g"},
    "expected three components": {"at": 0.1, "switch": "load.g", "to": {"acceleration": [0.0]}},
    "compares numbers": {"at": "2 N > 1 N", "release": "joint.hinge"},
}


@pytest.mark.parametrize("words", REFUSED)
def test_events_that_cannot_be_are_refused(words: str) -> None:
    with pytest.raises(InputError, match=words.replace("(", r"\(")) as error:
        pendulum({"e": REFUSED[words]})
    assert "[event.e" in str(error.value)


def test_a_lock_of_what_has_gone_is_refused() -> None:
    event = {"break": {"at": 0.1, "release": "joint.hinge"}, "brake": {"at": 0.2, "lock": "joint.hinge"}}
    with pytest.raises(InputError, match=r"\[event.brake.lock\]: joint.hinge is released by an earlier event"):
        pendulum(event)


def press(**changes: Any) -> Scene:
    return edited(load_scene(TREE / "scenes" / "gallery" / "shear_pin.toml"), changes)


def test_events_are_parameters_of_a_run() -> None:
    assert not simulation.params(press(event={}))["scene"].get("event")
    assert simulation.params(press()) != simulation.params(press(**{"event.break.at": "abs(pin.force) > 41 N m"}))


def test_points_of_sweeps_go_over_events() -> None:
    """A point records what the run of its scene has."""
    scene = press(**{"load.workpiece.stiffness": 2.5e4})
    names = ("slider.position.x.final", "pin.force.largest", "guide.velocity.series")
    recorded = [parse_recorded(name, scene.owners()) for name in names]
    point = Runner({}, recorded).run(scene)
    assert not point.refused
    run = dynamics.simulate(scene, {}, silent)
    assert float(point.values[names[0]]) == run["position"].sel(body="slider", axis="x").values[-1]
    assert float(point.values[names[1]]) == np.abs(run["drive_force"].sel(drive="pin").values).max()
    # two rows for each of the two events, of which none is at a regular output
    assert len(point.values[names[2]]) == run.sizes["time"] - 4 == 201


@pytest.mark.parametrize("result", [analyses.ensemble, analyses.sections, analyses.cost])
def test_results_that_know_no_events_refuse_them(result: Any) -> None:
    with pytest.raises(InputError, match="needs a scene without events"):
        result(press(), {}, silent)
