"""Small scenes with known answers: rigid bodies, springs, dampers, drives and joints."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from flexclear.numerics.rotations import quaternion_to_matrix, rotation_vector_to_matrix, skew
from tests.analytic.mechanism_runs import run
from tests.properties.mechanisms import body, frame, ground, joint, rigid, scene, simulate


def test_pendulum_follows_jacobis_functions() -> None:
    """IFToMM A01 asks for 1e-5 m at 10 s; from the horizontal, sin(theta/2) = k sn(K - w t), k^2 = 1/2."""
    dataset = run("checks/pendulum")
    sn, _, dn, _ = ellipj(ellipk(0.5) - np.sqrt(9.81) * dataset.time.values, 0.5)
    angle = 2.0 * np.arcsin(np.sqrt(0.5) * sn) * np.sign(dn)
    position = dataset.position.sel(body="bob").values
    assert position == pytest.approx(np.column_stack([-np.sin(angle), -np.cos(angle), 0.0 * angle]), abs=1e-8)


def test_heavy_top_follows_eulers_equations_to_its_published_end() -> None:
    dataset = run("checks/heavy_top").sel(body="top")
    moments = np.array([15.234375, 0.46875, 15.234375])  # about the fixed point

    def rhs(_: float, y: np.ndarray) -> np.ndarray:
        R, omega = y[:9].reshape(3, 3), y[9:]
        torque = np.cross([0.0, 15.0, 0.0], R.T @ [0.0, 0.0, -9.81])
        return np.concatenate([(R @ skew(omega)).ravel(), (torque - np.cross(omega, moments * omega)) / moments])

    y0 = np.concatenate([np.eye(3).ravel(), [0.0, 150.0, -4.61538]])
    time = dataset.time.values
    known = solve_ivp(rhs, (0.0, 1.0), y0, "DOP853", t_eval=time, rtol=1e-12, atol=1e-12)
    R = known.y[:9].T.reshape(-1, 3, 3)
    # ten nutations: errors of rtol 1e-10 per step add up over some hundred steps
    assert dataset.position.values == pytest.approx(R[:, :, 1], abs=1e-7)
    spin = np.einsum("ti,ti->t", dataset.angular_velocity.values, R[:, :, 1])
    assert spin == pytest.approx(150.0, abs=1e-6)
    # of the benchmark's converged solution
    assert dataset.position.values[-1] == pytest.approx([0.1733439, 0.6400886, -0.7484908], abs=1e-6)


def test_thrown_body_flies_a_parabola_and_keeps_its_angular_momentum() -> None:
    dataset = run("checks/free_body").sel(body="box")
    time = dataset.time.values[:, None]
    R0 = rotation_vector_to_matrix(np.array([0.3, -0.2, 0.5]))
    start = np.array([0.2, 0.0, 1.0]) + R0 @ [0.1, 0.0, 0.0]
    path = start + np.array([1.0, 2.0, 3.0]) * time + 0.5 * np.array([0.0, 0.0, -9.81]) * time**2
    assert dataset.position.values == pytest.approx(path, abs=1e-9)
    R = quaternion_to_matrix(dataset["quaternion"].values)
    inertia = R @ np.diag([0.02, 0.03, 0.04]) @ np.swapaxes(R, 1, 2)
    momentum = np.einsum("tij,tj->ti", inertia, dataset.angular_velocity.values)
    known = R0 @ np.diag([0.02, 0.03, 0.04]) @ R0.T @ [0.2, 10.0, -0.1]
    # the instability multiplies early errors by some hundred before the first flip ends
    assert momentum == pytest.approx(np.tile(known, (len(time), 1)), abs=1e-8)


# Welds ----------------------------------------------------------------------------------------------------------------

#: a force at (1, 0, 0) m [N] and its moment about the origin [N m]
FORCE, MOMENT = np.array([-30.0, 70.0, 20.0]), np.array([0.0, -20.0, 70.0])


@pytest.mark.parametrize("held", ["first", "second"])
@pytest.mark.parametrize("loaded", ["first", "second", "both"])
@pytest.mark.parametrize("by", ["load", "joint"])
def test_a_weld_carries_force_and_moment_from_one_side_to_the_other(held: str, loaded: str, by: str) -> None:
    """Two bodies welded at the origin; one is on a rail across the force at (1, 0, 0) m that acts on one or both.

    What the weld gives its second body balances all that acts beyond it: on the second body where the first is held,
    and what acts on the first where the second is held. The force is a load, or a joint's with a third body.
    """
    place, rail = {"position": [1.0, 0.0, 0.0]}, {"axes": {"z": [0.0, -2.0, 7.0], "x": [1.0, 0.0, 0.0]}}
    frames = {"O": {}, "rail": rail, "end": place}
    bodies = {"ground": {"type": "ground", "frames": frames}}
    bodies |= {name: rigid(1.0, 1.0, frames, pose={}) for name in ("first", "second")}
    joints = {"base": joint("prismatic", "ground.rail", f"{held}.rail"), "weld": joint("fixed", "first.O", "second.O")}
    loads = {}
    for name in ("first", "second"):
        if loaded not in (name, "both"):
            continue
        frame_of_load = f"{name}.end"
        if by == "joint":
            bodies[f"hook_{name}"] = rigid(1.0, 1.0, {"c": {}}, pose=place)
            joints[f"hinge_{name}"] = joint("spherical", f"{name}.end", f"hook_{name}.c")
            frame_of_load = f"hook_{name}.c"
        loads[name] = {"type": "point-force", "frame": frame_of_load, "force": FORCE.tolist()}
    found = simulate(scene(bodies, joints, end=0.01, load=loads)).sel(joint="weld")
    beyond, sign = ("second", -1.0) if held == "first" else ("first", 1.0)
    sign *= loaded in (beyond, "both")
    # exact at rest, to rounding of some hundred newtons; a body on a ball joint at its centre of mass stays where it is
    assert found.joint_force.values == pytest.approx(np.tile(sign * FORCE, (found.sizes["time"], 1)), abs=1e-9)
    assert found.joint_moment.values == pytest.approx(np.tile(sign * MOMENT, (found.sizes["time"], 1)), abs=1e-9)


@pytest.mark.parametrize("ground_first", [True, False])
def test_a_weld_to_the_ground_carries_what_hangs_on_its_bracket(ground_first: bool) -> None:
    """A body on a ball joint at the bracket's end, with a force at its centre: on the ground it is the same one."""
    place = {"position": [1.0, 0.0, 0.0]}
    bodies = {"ground": ground(O=(0.0, 0.0, 0.0)), "bracket": rigid(1.0, 1.0, {"O": {}, "end": place}, pose={})}
    bodies["hook"] = rigid(1.0, 1.0, {"c": {}}, pose=place)
    ends = ["ground.O", "bracket.O"] if ground_first else ["bracket.O", "ground.O"]
    joints = {"weld": joint("fixed", *ends), "hinge": joint("spherical", "bracket.end", "hook.c")}
    load = {"pull": {"type": "point-force", "frame": "hook.c", "force": FORCE.tolist()}}
    found, sign = simulate(scene(bodies, joints, end=0.01, load=load)).sel(joint="weld"), -1.0 if ground_first else 1.0
    assert found.joint_force.values == pytest.approx(np.tile(sign * FORCE, (found.sizes["time"], 1)), abs=1e-9)
    assert found.joint_moment.values == pytest.approx(np.tile(sign * MOMENT, (found.sizes["time"], 1)), abs=1e-9)


# Springs, dampers, drives --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_cardan_joint_turns_unevenly_by_its_formula() -> None:
    dataset = run("checks/universal_shaft")
    bend, first = np.radians(30.0), dataset.drive_position.sel(drive="motor").values
    second = dataset.sel(coordinate="plate.rotation")
    known = np.unwrap(np.arctan2(np.sin(first), np.cos(bend) * np.cos(first)))
    # closed to 1e-13 of a mechanism of some 0.1 m
    assert second.joint_position.values == pytest.approx(known, abs=1e-10)
    ratio = np.cos(bend) / (1.0 - np.sin(bend) ** 2 * np.cos(first) ** 2)
    assert second.joint_velocity.values == pytest.approx(4.0 * np.pi * ratio, rel=1e-10)
    # power in is power stored: the motor's torque against the change of the kinetic energy
    inertia = 5e-4 + 2e-4
    power = inertia * second.joint_velocity.values * second.joint_acceleration.values
    cross = dataset.kinetic.values - 0.5 * inertia * second.joint_velocity.values**2
    # the second shaft turns about its centre, which the crossing of the axes holds: the rest is the first shaft's
    assert cross == pytest.approx(0.5 * 1e-3 * (4.0 * np.pi) ** 2, rel=1e-10)
    assert dataset.drive_force.sel(drive="motor").values * 4.0 * np.pi == pytest.approx(power, abs=1e-9)


@pytest.mark.slow
def test_a_joint_with_one_freedom_driven_and_one_free() -> None:
    dataset = run("checks/spindle")
    t, omega = dataset.time.values, 3.0 * np.pi
    about_axis = 0.04 + 3.0 * 0.1**2
    turning = -np.radians(60.0) * omega**2 * np.cos(omega * t)
    assert dataset.drive_force.sel(drive="turning").values == pytest.approx(about_axis * turning, abs=1e-10)
    angle = dataset.joint_position.sel(coordinate="axis.rotation").values
    assert angle == pytest.approx(np.radians(60.0) * (np.cos(omega * t) - 1.0), abs=1e-13)
    fall = -3.0 * 9.81 / 300.0 * (1.0 - np.cos(10.0 * t))
    assert dataset.joint_position.sel(coordinate="axis.translation").values == pytest.approx(fall, abs=1e-10)
    assert np.abs(dataset.energy_error.values).max() < 1e-9


@pytest.mark.slow
def test_a_partly_driven_joint_may_be_written_the_other_way_round() -> None:
    """With its first frame on the rotor, both coordinates change their signs, and so do the law and the force."""
    known = run("checks/spindle")
    other = run(
        "checks/spindle",
        (
            ("joint.axis.between", ("rotor.axis", "ground.axis")),
            ("drive.turning.law.amplitude", ("-60 deg",)),
            ("drive.turning.law.offset", "60 deg"),
        ),
    )
    # the same equations but for the order in which numbers are added
    for field, sign in (("position", 1.0), ("acceleration", 1.0), ("drive_force", -1.0), ("joint_position", -1.0)):
        assert sign * other[field].values == pytest.approx(known[field].values, abs=1e-9), field


@pytest.mark.slow
def test_a_torsion_spring_counts_its_turns() -> None:
    """Released five half turns from its rest, it swings through all of them: theta = 5 pi (1 - cos(w t))."""
    spring = {"type": "joint-spring", "joint": "hinge", "stiffness": "2 N m/rad", "rest": 5.0 * np.pi}
    wheel = body((0.0, 0.0, 0.0), frames={"axle": frame((0.0, 0.0, 0.0))}, com=[0.0, 0.0, 0.0])
    table = scene(
        {"base": ground(O=(0.0, 0.0, 0.0)), "wheel": wheel},
        {"hinge": joint("revolute", "base.O", "wheel.axle")},
        end=1.0,
        load={"spring": spring},
        output={"interval": 0.01},
    )
    dataset = simulate(table)
    known = 5.0 * np.pi * (1.0 - np.cos(np.sqrt(2.0 / 0.015) * dataset.time.values))
    # rtol 1e-12 of thirty radians over some ten steps
    assert dataset.joint_position.values[:, 0] == pytest.approx(known, abs=1e-9)
    assert dataset.load_length.values[:, 0] == pytest.approx(known, abs=1e-9)
    assert dataset.elastic.values == pytest.approx((known - 5.0 * np.pi) ** 2, abs=1e-7)


@pytest.mark.slow
def test_a_spring_of_no_length_is_an_ordinary_spring() -> None:
    """A free body on it moves on an ellipse that may pass near, or through, the point where it has no direction."""
    table = scene(
        {
            "base": ground(O=(0.0, 0.0, 0.0)),
            "ball": body((0.2, 0.0, 0.0), frames={"C": frame((0.0, 0.0, 0.0))}, com=[0.0, 0.0, 0.0]),
        },
        {},
        end=1.0,
        load={"s": {"type": "spring-damper", "between": ["base.O", "ball.C"], "stiffness": 100.0, "free_length": 0.0}},
    )
    dataset = simulate(table)
    known = 0.2 * np.cos(10.0 * dataset.time.values)
    assert dataset.position.values[:, 0, 0] == pytest.approx(known, abs=1e-10)
    at_rest = dict(
        table, body={**table["body"], "ball": body((0.0, 0.0, 0.0), frames={"C": frame((0, 0, 0))}, com=[0, 0, 0])}
    )
    still = simulate(at_rest)
    assert np.abs(still.position.values).max() == 0.0
