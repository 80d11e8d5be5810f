"""Exponential functions of an oscillator's matrix, against those of the matrix as SciPy has its exponential."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from scipy.linalg import expm

from flexclear.pipeline.dynamics.integrate.phi_functions import PHI_COUNT, phi_functions
from tests.properties.kernels import from_python


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
