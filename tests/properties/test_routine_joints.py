"""Joint types of routines, on floats: motions are rates of poses, and positions are those that poses have."""

import numpy as np
import pytest

from flexclear.dynamics import joints
from flexclear.dynamics.mechanics import trees
from flexclear.dynamics.mechanics.joints import JOINTS, SERIES_ANGLE, _closed, series
from flexclear.dynamics.model.driving import joint_type


def test_every_joint_type_has_a_row() -> None:
    assert set(JOINTS) == set(joints.JOINTS)


def positions(kind: str, random: np.random.Generator, scale: float) -> np.ndarray:
    """Random positions of a joint; quaternions of another norm than 1."""
    return scale * random.normal(size=len(joint_type(kind).POSITIONS))


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind != "fixed"])
@pytest.mark.parametrize("scale", [1.0, 0.5 * SERIES_ANGLE**0.5 / 3.0])
def test_motions_of_joints_are_rates_of_their_poses(kind: str, scale: float) -> None:
    """By central differences along the rate of the positions, whose error is the square of the step; on floats."""
    random, step = np.random.default_rng(3), 1e-5
    x, u = positions(kind, random, scale), random.normal(size=len(joint_type(kind).SPEEDS))
    joint = JOINTS[kind]

    def twist(x: np.ndarray) -> np.ndarray:
        return np.concatenate(trees.total(joint.motion(x.tolist(), u.tolist()).S, u.tolist()))

    rate = np.array(joint.rate(x.tolist(), u.tolist()))
    ahead, behind = (joint.motion((x + side * step * rate).tolist(), u.tolist()) for side in (1.0, -1.0))
    here = joint.motion(x.tolist(), u.tolist())
    R, dR = np.reshape(here.R_FG, (3, 3)), np.subtract(ahead.R_FG, behind.R_FG).reshape(3, 3) / (2.0 * step)
    spin, v = dR @ R.T, np.subtract(ahead.p_FG, behind.p_FG) / (2.0 * step)
    assert twist(x) == pytest.approx([spin[2, 1], spin[0, 2], spin[1, 0], *v], abs=1e-8)
    growth = (twist(x + step * rate) - twist(x - step * rate)) / (2.0 * step)
    assert np.concatenate(here.bias) == pytest.approx(growth, abs=1e-8)


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind != "fixed"])
def test_positions_of_joints_are_those_that_poses_have(kind: str) -> None:
    """By what places the start pose; quaternions up to their norm."""
    x = positions(kind, np.random.default_rng(4), 0.7)
    here, size = JOINTS[kind].motion(x.tolist(), np.zeros(6).tolist()), np.ones(len(x))
    if kind in ("spherical", "free"):
        size[:4] = np.copysign(np.linalg.norm(x[:4]), x[0])
    found = joint_type(kind).coordinates(np.reshape(here.R_FG, (3, 3)), np.array(here.p_FG))
    assert found == pytest.approx(x / size, abs=1e-13)


def test_series_of_rotation_vectors_go_over_into_closed_forms() -> None:
    """The rates of the coefficients, which are differences over the squared angle of 0.01, lose four digits more."""
    found, exact = (of(SERIES_ANGLE) for of in (series, _closed))
    assert found[:3] == pytest.approx(exact[:3], abs=1e-13)
    assert found[3:] == pytest.approx(exact[3:], abs=1e-11)
