"""Rotations and products of series of vectors, as NumPy has them for one at a time."""

from __future__ import annotations

import numpy as np
import pytest

from flexclear.pipeline.core.numerics.rotations import cross, matrix_to_quaternion, quaternion_to_matrix, turned

#: rounding of sums of three products of numbers of one
ROUNDING = 1e-14


def series(*shape: int) -> np.ndarray:
    return np.random.default_rng(3).standard_normal(shape)


@pytest.mark.parametrize("order", ["C", "F"])
def test_products_of_series_are_those_of_numpy(order: str) -> None:
    """In whatever order they are in memory, and one for many; what they give is one component after the other."""
    R, v, w = (np.array(series(*shape), order=order) for shape in ((50, 7, 3, 3), (50, 7, 3), (7, 3)))  # type: ignore[call-overload]
    assert np.array_equal(cross(v, w), np.cross(v, w))
    np.testing.assert_allclose(turned(R, v), np.einsum("tbij,tbj->tbi", R, v), atol=ROUNDING)
    np.testing.assert_allclose(turned(R[0], v), np.einsum("bij,tbj->tbi", R[0], v), atol=ROUNDING)
    for found in (cross(v, w), turned(R, v)):
        assert found.flags.f_contiguous


def test_quaternions_of_matrices_are_theirs_for_every_angle() -> None:
    """Also of half turns, where w is zero and another component must be divided by; of one matrix, and of many."""
    q = np.concatenate([series(200, 4), np.eye(4), np.eye(4) + 1e-9 * series(4, 4)])
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    q *= np.where(q[:, :1] < 0.0, -1.0, 1.0)
    found = matrix_to_quaternion(quaternion_to_matrix(q))
    # of a half turn both signs are right
    same = np.minimum(np.abs(found - q).max(axis=1), np.abs(found + q).max(axis=1))
    assert same.max() < ROUNDING
    assert np.all(found[:, 0] >= 0.0)
    one = matrix_to_quaternion(quaternion_to_matrix(q[7]))
    assert one.shape == (4,)
    assert np.array_equal(one, found[7])
