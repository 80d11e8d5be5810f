"""Every joint type moves as its pose says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.algebra import rotation_vector_to_quaternion, skew
from pipeline.core.registry import lookup
from pipeline.dynamics import joints
from pipeline.dynamics import memory as m
from tests.properties.kernels import from_python

#: places in a work space of the tests' own
AT_X, AT_U, AT_DU, AT_RATE, AT_JOINT = 0, 7, 13, 19, 26
SIZE = AT_JOINT + m.JOINT.size
STEP = 1e-3
#: fourth-order differences over STEP: angular rates of some rad/s give 3^5 (1e-3)^4 / 30 = 1e-11, rounding 1e-12
DIFFERENCE = 1e-9
every_joint = pytest.mark.parametrize("name", joints.NAMES)


def declared(name: str) -> Any:
    return lookup(joints.__name__, name, where="test")


def move(name: str, x: np.ndarray, u: np.ndarray, du: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The joint's motion record and position rates."""
    w = np.full(SIZE, np.nan)  # what the kernel does not write must not be read
    w[AT_X : AT_X + len(x)], w[AT_U : AT_U + len(u)], w[AT_DU : AT_DU + len(du)] = x, u, du
    from_python(declared(name).motion)(w, AT_X, AT_U, AT_DU, AT_JOINT, AT_RATE)
    return w[AT_JOINT:], w[AT_RATE : AT_RATE + len(x)]


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


def later(name: str, x: np.ndarray, u: np.ndarray, du: np.ndarray, time: float) -> np.ndarray:
    """Positions after a time at the speeds u + du t, from the position rates alone (Runge-Kutta, 8 steps)."""
    h = time / 8.0
    for k in range(8):

        def rate(y: np.ndarray, share: float, k: int = k) -> np.ndarray:
            return move(name, y, u + du * h * (k + share), du)[1]

        a = rate(x, 0.0)
        b = rate(x + 0.5 * h * a, 0.5)
        c = rate(x + 0.5 * h * b, 0.5)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(x + h * c, 1.0))
    return x


def slope(values: dict[int, np.ndarray]) -> np.ndarray:
    """Derivative at 0 from the values at -2, -1, 1 and 2 steps."""
    return (8.0 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12.0 * STEP)


def records(name: str, x: np.ndarray, u: np.ndarray, du: np.ndarray) -> dict[int, np.ndarray]:
    found = {}
    for k in (-2, -1, 0, 1, 2):
        time = k * STEP
        found[k] = move(name, later(name, x, u, du, time), u + du * time, du)[0]
    return found


def rotation(record: np.ndarray) -> np.ndarray:
    return record[:9].reshape(3, 3)


def vector(record: np.ndarray, place: int) -> np.ndarray:
    return record[place : place + 3]


def columns(name: str, record: np.ndarray) -> np.ndarray:
    """Twist (angular; linear) per unit of each speed, shape (6, speeds)."""
    n = len(declared(name).SPEEDS)
    return record[m.JOINT.columns : m.JOINT.columns + 6 * n].reshape(n, 6).T


def seeds(test: Any) -> Any:
    """Some random coordinates: the kernels have no branches, so that few examples show all."""
    return settings(max_examples=20)(given(seed=st.integers(0, 2**32 - 1))(test))


@every_joint
@seeds
def test_rates_are_the_derivatives_of_the_pose(name: str, seed: int) -> None:
    found = records(name, *coordinates(name, seed))
    turning = slope({k: rotation(r) for k, r in found.items()}) @ rotation(found[0]).T
    assert turning == pytest.approx(skew(vector(found[0], m.JOINT.omega)), abs=DIFFERENCE)
    sliding = slope({k: vector(r, m.JOINT.position) for k, r in found.items()})
    assert sliding == pytest.approx(vector(found[0], m.JOINT.velocity), abs=DIFFERENCE)


@every_joint
@seeds
def test_second_rates_are_the_derivatives_of_the_rates(name: str, seed: int) -> None:
    """With the speeds' own rates zero, these are the biases; with any, the accelerations."""
    x, u, du = coordinates(name, seed)
    for second in (0.0 * du, du):
        found = records(name, x, u, second)
        for rate, place in ((m.JOINT.omega, m.JOINT.alpha), (m.JOINT.velocity, m.JOINT.acceleration)):
            change = slope({k: vector(r, rate) for k, r in found.items()})
            assert change == pytest.approx(vector(found[0], place), abs=DIFFERENCE)


@every_joint
@seeds
def test_columns_are_the_rates_per_unit_of_each_speed(name: str, seed: int) -> None:
    x, u, du = coordinates(name, seed)
    record, _ = move(name, x, u, du)
    twist = columns(name, record) @ u
    # products with zeros and ones
    assert np.concatenate([vector(record, m.JOINT.omega), vector(record, m.JOINT.velocity)]) == pytest.approx(
        twist, abs=1e-15
    )
    for k, unit in enumerate(np.eye(len(u))):
        found = records(name, x, unit, 0.0 * du)
        turning = slope({j: rotation(r) for j, r in found.items()}) @ rotation(found[0]).T
        sliding = slope({j: vector(r, m.JOINT.position) for j, r in found.items()})
        known = columns(name, record)[:, k]
        assert turning == pytest.approx(skew(known[:3]), abs=DIFFERENCE)
        assert sliding == pytest.approx(known[3:], abs=DIFFERENCE)


@every_joint
@seeds
def test_coordinates_invert_the_motion(name: str, seed: int) -> None:
    x, u, du = coordinates(name, seed)
    record, _ = move(name, x, u, du)
    R, p = rotation(record), vector(record, m.JOINT.position)
    # rounding of R, at angles of 3.1 rad divided by cos(1.55) = 0.02
    assert declared(name).coordinates(R, p) == pytest.approx(x, abs=1e-13)


@every_joint
@seeds
def test_rotations_are_rotations(name: str, seed: int) -> None:
    record, _ = move(name, *coordinates(name, seed))
    R = rotation(record)
    assert np.allclose(R.T @ R, np.eye(3), rtol=0.0, atol=1e-14)  # rounding
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("name", [n for n in joints.NAMES if declared(n).POSITIONS.startswith("rrrr")])
@given(seed=st.integers(0, 2**32 - 1), norm=st.floats(0.5, 2.0))
def test_quaternions_keep_their_norm_and_need_none(name: str, seed: int, norm: float) -> None:
    x, u, du = coordinates(name, seed)
    record, rate = move(name, x, u, du)
    scaled = np.concatenate([norm * x[:4], x[4:]])
    other, other_rate = move(name, scaled, u, du)
    # rounding of sums of four products of order one
    assert rotation(other) == pytest.approx(rotation(record), abs=1e-14)
    assert other_rate[:4] == pytest.approx(norm * rate[:4], abs=1e-14)
    assert x[:4] @ rate[:4] == pytest.approx(0.0, abs=1e-14)


@every_joint
@seeds
def test_a_closure_forbids_exactly_what_the_tree_joint_does_not_allow(name: str, seed: int) -> None:
    """Residuals vanish on all its motions, and rows and columns together fill the six dimensions."""
    part = declared(name)
    record, _ = move(name, *coordinates(name, seed))
    R, p = rotation(record), vector(record, m.JOINT.position)
    rows = [np.concatenate([np.zeros(3), np.eye(3)[k]]) for k in part.TRANSLATIONS]
    rows += [np.concatenate([np.cross(R[:, b], np.eye(3)[a]), np.zeros(3)]) for a, b in part.ROTATIONS]
    # rounding
    assert [p[k] for k in part.TRANSLATIONS] == pytest.approx([0.0] * len(part.TRANSLATIONS), abs=1e-15)
    assert [R[a, b] for a, b in part.ROTATIONS] == pytest.approx([0.0] * len(part.ROTATIONS), abs=1e-15)
    free, held = columns(name, record), np.array(rows).reshape(-1, 6)
    assert held @ free == pytest.approx(np.zeros((len(held), free.shape[1])), abs=1e-15)
    assert len(held) + free.shape[1] == 6
    # independent: unit vectors, so that a smallest singular value far from rounding means full rank
    assert np.linalg.svd(np.vstack([held, free.T]))[1].min() > 1e-3
