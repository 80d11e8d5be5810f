"""What is written here instead of imported from NumPy or SciPy does the same."""

import math
from math import factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.csgraph import reverse_cuthill_mckee as scipy_order

from flexclear.dynamics.contact.restitution import root
from flexclear.dynamics.integrate.phi_functions import PHI_COUNT, phi_functions
from flexclear.dynamics.model.index_tables import reverse_cuthill_mckee
from flexclear.dynamics.model.interface_basis import _families
from flexclear.numerics.rotations import cross, matrix_to_quaternion, quaternion_to_matrix, rotate
from tests.properties.kernels import from_python


@given(st.floats(0.01, 30.0), st.floats(0.0, 1.0), st.sampled_from([-1.0, 1.0]))
def test_a_root_is_scipys(stretch: float, fraction: float, sign: float) -> None:
    """Flat, steep and ordinary crossings, rising and falling."""

    def f(x: float) -> float:
        return sign * (math.atan(stretch * (x - fraction)) + 0.1 * (x - fraction) ** 3)

    known = brentq(f, -1.0, 2.0, xtol=1e-300, rtol=1e-15, maxiter=1000)
    # f is rounded near its root: there each may stop where the rounded function changes its sign
    assert abs(root(f, -1.0, 2.0) - known) <= 1e-14 * max(1.0, 1.0 / stretch)


def test_a_root_at_an_end_is_a_root_and_equal_signs_are_an_error() -> None:
    assert root(lambda x: x - 1.0, 1.0, 2.0) == 1.0
    assert root(lambda x: x - 2.0, 1.0, 2.0) == 2.0
    assert root(lambda x: 2.0 - x, 1.0, 2.0) == 2.0
    for line in (lambda x: x, lambda x: -x):
        with pytest.raises(ValueError, match="same sign"):
            root(line, 1.0, 2.0)


@given(st.integers(2, 25), st.floats(0.0, 0.6), st.booleans(), st.integers(0, 10**6))
def test_parts_and_order_of_a_graph_are_scipys_node_by_node(nodes: int, fraction: float, own: bool, seed: int) -> None:
    joined = np.random.default_rng(seed).random((nodes, nodes)) < fraction
    joined = joined | joined.T | (np.eye(nodes, dtype=bool) & own)
    graph = csr_array(joined.astype(float))
    assert reverse_cuthill_mckee(joined) == scipy_order(graph, symmetric_mode=True).tolist()
    parts, of = connected_components(graph, directed=False)
    assert _families(joined) == [np.flatnonzero(of == part).tolist() for part in range(parts)]


# Rotations and products of series of vectors ------------------------------------------------------------------------

#: rounding of sums of three products of numbers of one
ROUNDING = 1e-14


def series(*shape: int) -> np.ndarray:
    return np.random.default_rng(3).standard_normal(shape)


@pytest.mark.parametrize("order", ["C", "F"])
def test_products_of_series_are_those_of_numpy(order: str) -> None:
    """In whatever order they are in memory, and one for many; what they give is one component after the other."""
    R, v, w = (np.array(series(*shape), order=order) for shape in ((50, 7, 3, 3), (50, 7, 3), (7, 3)))  # type: ignore[call-overload]
    assert np.array_equal(cross(v, w), np.cross(v, w))
    np.testing.assert_allclose(rotate(R, v), np.einsum("tbij,tbj->tbi", R, v), atol=ROUNDING)
    np.testing.assert_allclose(rotate(R[0], v), np.einsum("bij,tbj->tbi", R[0], v), atol=ROUNDING)
    for found in (cross(v, w), rotate(R, v)):
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


# Exponential functions of an oscillator's matrix --------------------------------------------------------------------


def by_exponential(X: np.ndarray, k: int) -> np.ndarray:
    """phi_k(X), an entry of the exponential of a larger matrix: Hochbruck & Ostermann (2010), sec. 2.1."""
    big = np.zeros((2 + 2 * k, 2 + 2 * k))
    big[:2, :2] = X
    if k:
        big[:-2, 2:] += np.eye(2 * k)
        big[:2, 2:4] = np.eye(2)
        big[2:-2, 2:4] = 0.0
    return expm(big)[:2, -2:] if k else expm(X)


@pytest.mark.parametrize("a", [0.0, 1e-6, 0.13, 0.3, 0.99, 1.01, 7.0, 2.5e3])
@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.9, 1.0, 1.02, 1.21, 1.3, 2.0, 40.0])
def test_they_are_those_of_the_matrix(a: float, ratio: float) -> None:
    """Swinging, at the critical damping, and creeping back."""
    b, w = 2.0 * ratio * np.sqrt(a), np.zeros(2 * PHI_COUNT)
    from_python(phi_functions)(w, 0, a, b)
    X = np.array([[0.0, 1.0], [-a, -b]])
    for k in range(PHI_COUNT):
        alpha, beta = w[2 * k : 2 * k + 2]
        # at most some 22 000 roundings of 1/k! in each number (a = 0.13), with room; beta times the largest entry of X
        tolerance = 1e-10 / factorial(k) * max(1.0, a, b)
        np.testing.assert_allclose(alpha * np.eye(2) + beta * X, by_exponential(X, k), rtol=0.0, atol=tolerance)
