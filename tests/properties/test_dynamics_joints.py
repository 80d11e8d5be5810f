"""Every joint type moves as its pose says; every drive law is smooth where it must be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.algebra import rotation_vector_to_quaternion, skew
from pipeline.core.registry import lookup
from pipeline.core.scene.parts import Constant, Step
from pipeline.dynamics import drives, joints
from pipeline.dynamics.tables import (
    J_ACCELERATION,
    J_ALPHA,
    J_COLUMNS,
    J_OMEGA,
    J_POSITION,
    J_VELOCITY,
    JOINT_SIZE,
)
from tests.analytic.mechanism_runs import run

#: places in a work space of the tests' own
AT_X, AT_U, AT_DU, AT_RATE, AT_JOINT = 0, 7, 13, 19, 26
SIZE = AT_JOINT + JOINT_SIZE
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
    declared(name).motion(w, AT_X, AT_U, AT_DU, AT_JOINT, AT_RATE)
    return w[AT_JOINT:], w[AT_RATE : AT_RATE + len(x)]


def coordinates(name: str, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Any positions, speeds and accelerations of a joint; a quaternion has the norm 1 and w > 0."""
    random = np.random.default_rng(seed)
    part = declared(name)
    x = random.uniform(-2.0, 2.0, len(part.POSITIONS))
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
    return record[J_COLUMNS : J_COLUMNS + 6 * n].reshape(n, 6).T


def seeds(test: Any) -> Any:
    """Some random coordinates: the kernels have no branches, so that few examples show all."""
    return settings(max_examples=20)(given(seed=st.integers(0, 2**32 - 1))(test))


@every_joint
@seeds
def test_rates_are_the_derivatives_of_the_pose(name: str, seed: int) -> None:
    found = records(name, *coordinates(name, seed))
    turning = slope({k: rotation(r) for k, r in found.items()}) @ rotation(found[0]).T
    assert turning == pytest.approx(skew(vector(found[0], J_OMEGA)), abs=DIFFERENCE)
    sliding = slope({k: vector(r, J_POSITION) for k, r in found.items()})
    assert sliding == pytest.approx(vector(found[0], J_VELOCITY), abs=DIFFERENCE)


@every_joint
@seeds
def test_second_rates_are_the_derivatives_of_the_rates(name: str, seed: int) -> None:
    """With the speeds' own rates zero, these are the biases; with any, the accelerations."""
    x, u, du = coordinates(name, seed)
    for second in (0.0 * du, du):
        found = records(name, x, u, second)
        for rate, place in ((J_OMEGA, J_ALPHA), (J_VELOCITY, J_ACCELERATION)):
            change = slope({k: vector(r, rate) for k, r in found.items()})
            assert change == pytest.approx(vector(found[0], place), abs=DIFFERENCE)


@every_joint
@seeds
def test_columns_are_the_rates_per_unit_of_each_speed(name: str, seed: int) -> None:
    x, u, du = coordinates(name, seed)
    record, _ = move(name, x, u, du)
    twist = columns(name, record) @ u
    # products with zeros and ones
    assert np.concatenate([vector(record, J_OMEGA), vector(record, J_VELOCITY)]) == pytest.approx(twist, abs=1e-15)
    for k, unit in enumerate(np.eye(len(u))):
        found = records(name, x, unit, 0.0 * du)
        turning = slope({j: rotation(r) for j, r in found.items()}) @ rotation(found[0]).T
        sliding = slope({j: vector(r, J_POSITION) for j, r in found.items()})
        known = columns(name, record)[:, k]
        assert turning == pytest.approx(skew(known[:3]), abs=DIFFERENCE)
        assert sliding == pytest.approx(known[3:], abs=DIFFERENCE)


@every_joint
@seeds
def test_coordinates_invert_the_motion(name: str, seed: int) -> None:
    x, u, du = coordinates(name, seed)
    record, _ = move(name, x, u, du)
    R, p = rotation(record), vector(record, J_POSITION)
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
    R, p = rotation(record), vector(record, J_POSITION)
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


# Drives -------------------------------------------------------------------------------------------------------------

#: eq. (35): 60 mm out and back
STROKE = Step(type="step", start=(0.0, 0.09), end=(0.09, 0.18), change=(0.06, -0.06))
#: drive law -> instances; overlapping steps, gaps and a step of no change among them
LAWS: dict[str, tuple[Any, ...]] = {
    "constant": (Constant(type="constant", value=0.012), Constant(type="constant")),
    "step": (
        STROKE,
        Step(type="step", start=(0.2, 0.0, 0.25), end=(0.3, 0.5, 0.26), change=(0.1, -0.2, 0.05)),
        Step(type="step", start=(0.1, 0.7), end=(0.4, 0.8), change=(0.0, 1.0)),
    ),
}


def pieces(law: Any) -> np.ndarray:
    return lookup(drives.__name__, law.type, where="test")(law)


def value(law: Any, t: float, order: int = 0, side: str = "right") -> float:
    """A derivative of the law at t, from the piece that holds right (or left) of it."""
    table = pieces(law)
    k = max(int(np.searchsorted(table[:, 0], t, side=side)) - 1, 0)  # type: ignore[call-overload]
    return float(np.polynomial.Polynomial(table[k, 1:]).deriv(order)(t - table[k, 0]))


def adams_step(t: float, t0: float, h0: float, t1: float, h1: float) -> float:
    """Wang & Wang (2019), eq. (29)."""
    s = min(max((t - t0) / (t1 - t0), 0.0), 1.0)
    return h0 + (h1 - h0) * s * s * (3.0 - 2.0 * s)


def scale(law: Any, order: int) -> float:
    """Size of what is summed in a derivative of the law."""
    if law.type == "constant":
        return 1.0
    parts = zip(law.start, law.end, law.change, strict=True)
    return 1e-3 + sum(6.0 * abs(h) / (b - a) ** order for a, b, h in parts)


every_law = pytest.mark.parametrize("law", [law for laws in LAWS.values() for law in laws], ids=lambda law: law.type)
spans = st.tuples(st.floats(0.0, 1.0), st.floats(0.01, 1.0), st.floats(-0.1, 0.1))


def test_every_drive_law_is_tried_here() -> None:
    assert set(LAWS) == set(drives.NAMES)


@every_law
def test_value_and_rate_do_not_jump_between_pieces(law: Any) -> None:
    for t in pieces(law)[:, 0]:
        for order in (0, 1):
            left, right = (value(law, t, order, side) for side in ("left", "right"))
            # rounding of (t - start) / (end - start)
            assert left == pytest.approx(right, abs=1e-13 * scale(law, order))


@every_law
def test_pieces_start_in_order(law: Any) -> None:
    table = pieces(law)
    assert table.shape[1] == 7
    assert np.all(np.diff(table[:, 0]) > 0.0)


def test_a_constant_drive_holds_its_value() -> None:
    for law in LAWS["constant"]:
        assert [value(law, t) for t in (-1.0, 0.0, 3.0)] == [law.value] * 3
        assert [value(law, t, order) for t in (-1.0, 3.0) for order in (1, 2)] == [0.0] * 4


@given(steps=st.lists(spans, min_size=1, max_size=4), t=st.floats(-0.5, 2.5))
def test_a_step_drive_is_the_sum_of_eq_29(steps: list[tuple[float, float, float]], t: float) -> None:
    start, end, change = ([f(s) for s in steps] for f in (lambda s: s[0], lambda s: s[0] + s[1], lambda s: s[2]))
    law = Step(type="step", start=tuple(start), end=tuple(end), change=tuple(change))
    known = sum(adams_step(t, a, 0.0, b, h) for a, b, h in zip(start, end, change, strict=True))
    # (t - start) / (end - start) of steps of 0.01 s at 1 s: 100 roundings' worth, times slopes of 1.5
    assert value(law, t) == pytest.approx(known, abs=1e-13)


def test_the_papers_stroke_is_flat_at_its_ends_and_60_mm_high() -> None:
    # values of order 0.06 m, slopes of order 1 m/s, in rounding
    assert [value(STROKE, t) for t in (-0.1, 0.0, 0.045, 0.09, 0.135, 0.18, 1.0)] == pytest.approx(
        [0.0, 0.0, 0.03, 0.06, 0.03, 0.0, 0.0], abs=1e-16
    )
    assert [value(STROKE, t, 1) for t in (-0.1, 0.0, 0.045, 0.09, 0.18)] == pytest.approx(
        [0.0, 0.0, 1.5 * 0.06 / 0.09, 0.0, 0.0], abs=1e-14
    )


def test_the_papers_stroke_jumps_in_acceleration_at_its_ends_and_in_jerk_at_its_middle() -> None:
    """6 h / T^2 = 44.44 m/s^2 of eq. (35); 12 h / T^3 = 987.65 m/s^3."""
    jump, jerk = 6.0 * 0.06 / 0.09**2, 12.0 * 0.06 / 0.09**3
    sides = {t: [value(STROKE, t, 2, side) for side in ("left", "right")] for t in (0.0, 0.09, 0.18)}
    # rounding of s = 1 in 6 h (1 - 2 s) / T^2
    assert sides[0.0] == pytest.approx([0.0, jump], abs=1e-12)
    assert sides[0.09] == pytest.approx([-jump, -jump], abs=1e-12)
    assert sides[0.18] == pytest.approx([jump, 0.0], abs=1e-12)
    assert [value(STROKE, 0.09, 3, side) for side in ("left", "right")] == pytest.approx([-jerk, jerk], rel=1e-13)


def test_a_run_is_driven_by_eq_35() -> None:
    dataset = run("sps4/ideal")
    found = dataset.drive_position.transpose("time", "drive").to_pandas()
    stroke = [adams_step(t, 0.0, 0.0, 0.09, 0.06) + adams_step(t, 0.09, 0.0, 0.18, -0.06) for t in found.index]
    for name in ("P1", "P2"):
        # rounding of 60 mm and of t
        assert found[name].to_numpy() == pytest.approx(np.array(stroke), abs=1e-15)
    assert np.abs(found[["P3", "P4"]].to_numpy()).max() == 0.0
