"""Small scenes with known answers: rigid bodies, springs, dampers, drives and joints."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from flexclear.numerics.rotations import quaternion_to_matrix, rotation_vector_to_matrix, skew
from tests.analytic.mechanism_runs import run
from tests.properties.mechanisms import body, frame, ground, joint, scene, simulate


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
