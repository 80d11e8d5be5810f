"""Every joint type moves as its pose says."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexclear.dynamics import joints
from flexclear.dynamics.model.constraints import Demands, demands, joint_positions, moved_frame
from flexclear.dynamics.model.merge import Placement
from flexclear.numerics.rotations import rotation_vector_to_matrix, rotation_vector_to_quaternion, skew

STEP = 1e-3
#: fourth-order differences over STEP: angular rates of some rad/s give 3^5 (1e-3)^4 / 30 = 1e-11, rounding 1e-12
DIFFERENCE = 1e-9
every_joint = pytest.mark.parametrize("name", joints.JOINTS)


@dataclass(frozen=True)
class Motion:
    """Of the second frame in the first: pose, twist S u, its rate S u' + bias, and S, shape (6, speeds)."""

    R: np.ndarray
    p: np.ndarray
    twist: np.ndarray
    second: np.ndarray
    subspace: np.ndarray
    rate: np.ndarray


def declared(name: str) -> Any:
    return joints.JOINTS[name]


def move(name: str, x: np.ndarray, u: np.ndarray, du: np.ndarray) -> Motion:
    """What the joint says."""
    part = declared(name)
    R, p, S, bias = part.motion(x.tolist(), u.tolist())
    twists = np.reshape(S, (len(u), 6))
    second = twists.T @ du + np.ravel(bias)
    rate = np.array(part.position_rate(x.tolist(), u.tolist()))
    return Motion(np.reshape(R, (3, 3)), np.array(p), twists.T @ u, second, twists.T, rate)


def coordinates(name: str, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Any positions, speeds and accelerations of a joint; a quaternion has the norm 1 and w > 0."""
    random = np.random.default_rng(seed)
    part = declared(name)
    x = random.uniform(-2.0, 2.0, len(part.POSITIONS))
    if name == "rotation-vector":
        x *= random.choice([1e-3, 0.05, 1.4]) / np.linalg.norm(x) * 2.0  # below pi: its inverse is unique there
    if part.POSITIONS.startswith("rrrr"):
        turning = random.normal(size=3)
        x[:4] = rotation_vector_to_quaternion(turning / np.linalg.norm(turning) * random.uniform(0.0, 3.1))
    return x, random.uniform(-2.0, 2.0, len(part.SPEEDS)), random.uniform(-5.0, 5.0, len(part.SPEEDS))


def anywhere(seed: int) -> Placement:
    """Any frame."""
    random = np.random.default_rng(seed)
    return Placement(random.uniform(-2.0, 2.0, 3), rotation_vector_to_matrix(random.normal(size=3)))


def later(name: str, x: np.ndarray, u: np.ndarray, du: np.ndarray, time: float) -> np.ndarray:
    """Positions after a time at the speeds u + du t, from the position rates alone (Runge-Kutta, 8 steps)."""
    h = time / 8.0
    for k in range(8):

        def rate(y: np.ndarray, fraction: float, k: int = k) -> np.ndarray:
            return move(name, y, u + du * h * (k + fraction), du).rate

        a = rate(x, 0.0)
        b = rate(x + 0.5 * h * a, 0.5)
        c = rate(x + 0.5 * h * b, 0.5)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + h * c, 1.0))
    return x


def slope(values: dict[int, np.ndarray]) -> np.ndarray:
    """Derivative at 0 from the values at -2, -1, 1 and 2 steps."""
    return (8.0 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12.0 * STEP)


def motions(name: str, x: np.ndarray, u: np.ndarray, du: np.ndarray) -> dict[int, Motion]:
    found = {}
    for k in (-2, -1, 0, 1, 2):
        time = k * STEP
        found[k] = move(name, later(name, x, u, du, time), u + du * time, du)
    return found


def seeds(test: Any) -> Any:
    """Some random coordinates: motions have few branches, so that few examples show all."""
    return settings(max_examples=20)(given(seed=st.integers(0, 2**32 - 1))(test))


def turning(found: dict[int, Motion]) -> np.ndarray:
    """R' R^T, by differences."""
    return slope({k: motion.R for k, motion in found.items()}) @ found[0].R.T


def sliding(found: dict[int, Motion]) -> np.ndarray:
    """p', by differences."""
    return slope({k: motion.p for k, motion in found.items()})


@every_joint
@seeds
def test_rates_are_the_derivatives_of_the_pose(name: str, seed: int) -> None:
    found = motions(name, *coordinates(name, seed))
    assert turning(found) == pytest.approx(skew(found[0].twist[:3]), abs=DIFFERENCE)
    assert sliding(found) == pytest.approx(found[0].twist[3:], abs=DIFFERENCE)


@every_joint
@seeds
def test_second_rates_are_the_derivatives_of_the_rates(name: str, seed: int) -> None:
    """With the speeds' own rates zero, these are the biases; with any, the accelerations."""
    x, u, du = coordinates(name, seed)
    for second in (0.0 * du, du):
        found = motions(name, x, u, second)
        change = slope({k: motion.twist for k, motion in found.items()})
        assert change == pytest.approx(found[0].second, abs=DIFFERENCE)


@every_joint
@seeds
def test_the_motion_subspace_holds_the_rates_per_unit_of_each_speed(name: str, seed: int) -> None:
    x, u, du = coordinates(name, seed)
    known = move(name, x, u, du).subspace
    for k, unit in enumerate(np.eye(len(u))):
        found = motions(name, x, unit, 0.0 * du)
        assert turning(found) == pytest.approx(skew(known[:3, k]), abs=DIFFERENCE)
        assert sliding(found) == pytest.approx(known[3:, k], abs=DIFFERENCE)


@every_joint
@seeds
def test_coordinates_invert_the_motion(name: str, seed: int) -> None:
    x, u, du = coordinates(name, seed)
    motion = move(name, x, u, du)
    F = anywhere(seed)
    # rounding of R, at angles of 3.1 rad divided by cos(1.55) = 0.02
    assert joint_positions(name, F, F.of(Placement(motion.p, motion.R))) == pytest.approx(x, abs=1e-13)


@every_joint
@seeds
def test_wrenches_of_conditions_and_coordinates_have_their_rates_as_power(name: str, seed: int) -> None:
    """Whatever the frames do: also against what the joint forbids."""
    x, *_ = coordinates(name, seed)
    F, twist = anywhere(seed), np.random.default_rng(seed).uniform(-2.0, 2.0, 6)
    G, values = moved_frame(name, F, x), dict.fromkeys(range(len(declared(name).COORDINATES)), 0.0)

    def demanded(time: float) -> Demands:
        turn = rotation_vector_to_matrix(time * twist[:3])
        return demands(name, F, Placement(G.p + time * twist[3:], turn @ G.R), values)

    found = {k: demanded(k * STEP).residuals for k in (-2, -1, 1, 2)}
    assert demanded(0.0).wrenches @ twist == pytest.approx(slope(found), abs=DIFFERENCE)


@every_joint
@seeds
def test_rotations_are_rotations(name: str, seed: int) -> None:
    R = move(name, *coordinates(name, seed)).R
    # a product of up to three rotations, each with some five roundings of 1.1e-16 in every entry; a determinant adds up
    # what three entries are off
    assert np.allclose(R.T @ R, np.eye(3), rtol=0.0, atol=2e-14)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=2e-14)


@pytest.mark.parametrize("name", [n for n in joints.JOINTS if declared(n).POSITIONS.startswith("rrrr")])
@given(seed=st.integers(0, 2**32 - 1), norm=st.floats(0.5, 2.0))
def test_quaternions_keep_their_norm_and_need_none(name: str, seed: int, norm: float) -> None:
    x, u, du = coordinates(name, seed)
    motion = move(name, x, u, du)
    rate = motion.rate
    scaled = np.concatenate([norm * x[:4], x[4:]])
    other = move(name, scaled, u, du)
    # rounding of sums of four products of order one
    assert pytest.approx(motion.R, abs=1e-14) == other.R
    assert other.rate[:4] == pytest.approx(norm * rate[:4], abs=1e-14)
    assert x[:4] @ rate[:4] == pytest.approx(0.0, abs=1e-14)


@every_joint
@seeds
def test_a_closure_forbids_exactly_what_the_tree_joint_does_not_allow(name: str, seed: int) -> None:
    """Residuals vanish on all its motions, and rows and columns together fill the six dimensions."""
    part = declared(name)
    motion = move(name, *coordinates(name, seed))
    R, p = motion.R, motion.p
    rows = [np.concatenate([np.zeros(3), np.eye(3)[k]]) for k in part.TRANSLATIONS]
    rows += [np.concatenate([np.cross(R[:, b], np.eye(3)[a]), np.zeros(3)]) for a, b in part.ROTATIONS]
    # rounding
    assert [p[k] for k in part.TRANSLATIONS] == pytest.approx([0.0] * len(part.TRANSLATIONS), abs=1e-15)
    assert [R[a, b] for a, b in part.ROTATIONS] == pytest.approx([0.0] * len(part.ROTATIONS), abs=1e-15)
    free, held = motion.subspace, np.array(rows).reshape(-1, 6)
    assert held @ free == pytest.approx(np.zeros((len(held), free.shape[1])), abs=1e-15)
    assert len(held) + free.shape[1] == 6
    # independent: unit vectors, so that a smallest singular value far from rounding means full rank
    assert np.linalg.svd(np.vstack([held, free.T]))[1].min() > 1e-3
