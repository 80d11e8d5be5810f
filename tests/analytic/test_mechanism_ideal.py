"""The ideal mechanism: engine against closed-form motion and inverse dynamics."""

from functools import cache

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import quaternion_to_matrix
from tests.analytic.mechanism_runs import run
from tests.reference import sps4
from tests.reference.ideal_motion import UP, Motion, ideal
from tests.reference.inverse_dynamics import Reactions, reactions

DOWN = np.array([0.0, 0.0, -9.81])
#: height of the plate's centre of mass above the joint centres in the stacked variant [m]
RAISED = 22.5e-3
#: scene -> gravity and platform of the independent computation
CASES = {
    "sps4/ideal": (np.zeros(3), sps4.platform(sps4.LAYOUT)),
    "sps4/variants/gravity": (DOWN, sps4.platform(sps4.LAYOUT)),
    "sps4/variants/stacked": (np.zeros(3), sps4.platform(sps4.LAYOUT, RAISED, 7.048e-3)),
    "sps4/variants/prismatic_60mm": (np.zeros(3), sps4.platform(sps4.LAYOUT)),
    "sps4/variants/first": (np.zeros(3), sps4.platform(sps4.FIRST)),
}
LAYOUTS = {"sps4/variants/first": sps4.FIRST}
LEGS = range(1, 5)
every_case = pytest.mark.parametrize("scene", CASES)


@cache
def moved(layout: str) -> list[Motion]:
    """The independent motion at the output times of the ideal scene, by a key of LAYOUTS or ``""``."""
    time = run("sps4/ideal").time.values
    return ideal(LAYOUTS.get(layout, sps4.LAYOUT), time, np.where(time < 0.18, 1, -1))


def motions(scene: str) -> list[Motion]:
    """The independent motion of a scene's layout."""
    return moved(scene if scene in LAYOUTS else "")


@cache
def forces(scene: str) -> list[Reactions]:
    """The independent reactions at the output times."""
    return [reactions(m, *CASES[scene]) for m in motions(scene)]


def close(found: xr.DataArray, expected: list[np.ndarray], fraction: float) -> bool:
    """Whether vectors agree to a share of the largest one of the run."""
    expected_array = np.array(expected)
    return bool(np.abs(found.values - expected_array).max() <= fraction * np.abs(expected_array).max())


@every_case
def test_pose_is_the_inverse_of_the_leg_lengths_at_every_output(scene: str) -> None:
    dataset = run(scene).sel(body="platform")
    height = RAISED if scene.endswith("stacked") else 0.0
    centre = np.array([m.height * UP + m.rotation @ (height * UP) for m in motions(scene)])
    assert np.abs(dataset.position.values - centre).max() <= 1e-9
    turn = quaternion_to_matrix(dataset["quaternion"].values)
    error = turn @ np.array([m.rotation.T for m in motions(scene)])
    angle = np.linalg.norm(error - np.eye(3), axis=(1, 2)) / np.sqrt(2.0)
    assert angle.max() <= 1e-9


@pytest.mark.parametrize("scene", ["sps4/ideal", "sps4/variants/gravity", "sps4/variants/first"])
def test_speeds_and_accelerations_are_the_known_ones_at_every_output(scene: str) -> None:
    dataset = run(scene).sel(body="platform")
    # the state is projected to the constraints at 1e-13 of its size; rates follow linearly
    assert close(dataset.velocity, [m.speed * UP for m in motions(scene)], 1e-9)
    assert close(dataset.angular_velocity, [m.omega for m in motions(scene)], 1e-9)
    assert close(dataset.acceleration, [m.acceleration * UP for m in motions(scene)], 1e-8)
    assert close(dataset.angular_acceleration, [m.alpha for m in motions(scene)], 1e-8)


@every_case
def test_loops_stay_closed(scene: str) -> None:
    assert run(scene).constraint_error.max() <= 1e-10


@every_case
def test_all_reactions_at_balls_are_those_of_inverse_dynamics(scene: str) -> None:
    force = run(scene).joint_force
    for k in LEGS:
        assert close(force.sel(joint=f"A{k}"), [r.at_A[k - 1] for r in forces(scene)], 1e-6)
        assert close(force.sel(joint=f"B{k}"), [r.at_B[k - 1] for r in forces(scene)], 1e-6)
    assert close(force.sel(joint="C"), [r.at_C for r in forces(scene)], 1e-6)
    assert close(force.sel(joint="Z"), [r.at_Z for r in forces(scene)], 1e-6)


@every_case
def test_drive_forces_are_those_of_inverse_dynamics(scene: str) -> None:
    found = run(scene).drive_force.sel(drive=[f"P{k}" for k in LEGS])
    assert close(found, [r.drive for r in forces(scene)], 1e-6)


@every_case
def test_prismatic_joints_carry_the_forces_across_the_legs(scene: str) -> None:
    for k in LEGS:
        found = run(scene).joint_force.sel(joint=f"P{k}").values
        axes = np.array([m.legs[0][k - 1] for m in motions(scene)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        across = found - np.sum(found * axes, axis=1, keepdims=True) * axes
        expected = np.array([r.across[k - 1] for r in forces(scene)])
        assert np.abs(across - expected).max() <= 1e-6 * np.abs(expected).max()


@every_case
def test_spherical_joints_carry_no_moment(scene: str) -> None:
    dataset = run(scene)
    names = [f"{end}{k}" for end in "AB" for k in LEGS] + ["C"]
    # moments of the forces at hand about points centimetres away are some newton metres
    assert np.abs(dataset.joint_moment.sel(joint=names)).max() <= 1e-7


@every_case
def test_legs_do_not_spin(scene: str) -> None:
    dataset = run(scene)
    for k in LEGS:
        axes = np.array([m.legs[0][k - 1] for m in motions(scene)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        for part in ("rod", "cylinder", "ball_A", "ball_B"):
            spin = np.sum(dataset.angular_velocity.sel(body=f"{part}{k}").values * axes, axis=1)
            assert np.abs(spin).max() <= 1e-8


@every_case
def test_energy_ledger_closes(scene: str) -> None:
    dataset = run(scene)
    assert np.abs(dataset.energy_error).max() <= 1e-7 * max(dataset.kinetic.max(), np.abs(dataset.potential).max())
