"""The symmetric eigenproblem K x = lambda M x from its lower end, the same in every process."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from flexclear.pipeline.core.system.errors import InputError, SolverError

#: up to here the dense solver is as quick, finds every multiple root, and gives complete bases
DENSE_LIMIT = 900
#: relative distance below which two frequencies count as one
EQUAL = 1e-6
#: modal masses further than this from one are computed again from the modes themselves
ORTHONORMAL = 1e-12


def dense(stiffness: sp.csr_array, mass: sp.csr_array, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The `count` lowest eigenvalues [rad^2/s^2], ascending, and mass-normalised vectors, shape (n, count).

    Raises InputError when the mass matrix is not positive definite.
    """
    try:
        values, vectors = scipy.linalg.eigh(stiffness.toarray(), mass.toarray())
    except np.linalg.LinAlgError:
        raise InputError("mesh", "the mass matrix is not positive definite", "give every coordinate a mass") from None
    return values[:count], vectors[:, :count]


def inverted(
    stiffness: sp.csr_array,
    mass: sp.csr_array,
    count: int,
    inverse: Callable[[np.ndarray], np.ndarray],
    tolerance: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """The `count` lowest eigenpairs by Lanczos steps with the inverse, which takes loads to displacements.

    Eigenvalues [rad^2/s^2] ascending; vectors mass-normalised, shape (n, count).  tolerance: zero for all digits.
    Raises SolverError when the solver does not deliver all of them.
    """
    n = mass.shape[0]
    # ARPACK starts from a random vector unless given one; in equal pairs that turns the shapes from run to run
    start = inverse(mass @ np.linspace(1.0, 2.0, n))
    operator = scipy.sparse.linalg.LinearOperator((n, n), matvec=inverse, dtype=float)
    try:
        values, vectors = scipy.sparse.linalg.eigsh(
            stiffness, k=count, M=mass, sigma=0.0, which="LM", v0=start, tol=tolerance, OPinv=operator
        )
    except scipy.sparse.linalg.ArpackError as error:
        raise SolverError(f"modes: the sparse eigensolver gave up on {count} of {n} modes: {error}") from None
    order = np.argsort(values)
    return values[order], vectors[:, order]


def gap(values: np.ndarray) -> tuple[int, float] | None:
    """How many eigenvalues lie below the last gap between unequal ones, and a value within it; None without gap."""
    gaps = np.flatnonzero(np.diff(values) > 2.0 * EQUAL * np.abs(values[1:]))
    if gaps.size == 0:
        return None
    last = int(gaps[-1])
    return last + 1, float(0.5 * (values[last] + values[last + 1]))


def rediagonalise(stiffness: sp.csr_array, mass: sp.csr_array, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and mass-normalised combinations of the columns of `basis`, ascending.

    basis: shape (ndof, n).  Raises SolverError when its columns depend on each other.
    """
    values, vectors = _rayleigh_ritz(stiffness, mass, basis)
    spread = vectors.T @ (mass @ vectors)
    if np.abs(spread - np.eye(len(values))).max() > ORTHONORMAL:
        # attachment modes of neighbouring frames are nearly parallel; the result is a well-conditioned start
        values, vectors = _rayleigh_ritz(stiffness, mass, vectors)
    return values, vectors


def _rayleigh_ritz(stiffness: sp.csr_array, mass: sp.csr_array, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # equal diagonals first: constraint modes and normal modes differ by orders in their norm
    scaled = basis / np.sqrt(np.einsum("ij,ij->j", basis, mass @ basis))
    K, M = scaled.T @ (stiffness @ scaled), scaled.T @ (mass @ scaled)
    try:
        values, combination = scipy.linalg.eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    except np.linalg.LinAlgError:
        raise SolverError(f"modes: the {basis.shape[1]} shapes of the basis depend on each other") from None
    return values, scaled @ combination


def frequency(values: np.ndarray) -> np.ndarray:
    """Eigenvalues [rad^2/s^2] to Hz; the rounding noise of rigid modes may be negative and is shown by its size."""
    return np.sqrt(np.abs(values)) / (2.0 * np.pi)
