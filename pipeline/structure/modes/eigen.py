"""The symmetric eigenproblem K x = lambda M x from its lower end, the same in every process."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from pipeline.core.errors import SolverError

#: up to here the dense solver is as quick, finds every multiple root, and gives complete bases
DENSE_LIMIT = 900
#: relative distance below which two frequencies count as one
EQUAL = 1e-6


def lowest(stiffness: sp.csr_array, mass: sp.csr_array, count: int, *, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """The `count` lowest eigenvalues [rad^2/s^2], ascending, and mass-normalised vectors, shape (n, count).

    shift: below the lowest eigenvalue wanted, so negative for a body that can move freely.
    Raises SolverError when the sparse solver does not deliver all of them.
    """
    n = mass.shape[0]
    if n <= DENSE_LIMIT or count > n // 4:
        values, vectors = scipy.linalg.eigh(stiffness.toarray(), mass.toarray())
        return values[:count], vectors[:, :count]
    # ARPACK starts from a random vector unless told; in equal pairs that turns the shapes from run to run
    start = np.linspace(1.0, 2.0, n)
    try:
        values, vectors = scipy.sparse.linalg.eigsh(
            stiffness.tocsc(), k=count, M=mass.tocsc(), sigma=shift, which="LM", v0=start, tol=0.0
        )
    except scipy.sparse.linalg.ArpackError as error:
        raise SolverError(f"modes: the sparse eigensolver gave up on {count} of {n} modes: {error}") from None
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    _nothing_missed(stiffness, mass, values)
    return values, vectors


def _nothing_missed(stiffness: sp.csr_array, mass: sp.csr_array, values: np.ndarray) -> None:
    """Sylvester's law of inertia: K - s M has as many negative pivots as there are eigenvalues below s."""
    gaps = np.flatnonzero(np.diff(values) > 2.0 * EQUAL * np.abs(values[1:]))
    if gaps.size == 0:
        return
    last = int(gaps[-1])
    between = float(0.5 * (values[last] + values[last + 1]))
    shifted = (stiffness - between * mass).tocsc()
    factors = scipy.sparse.linalg.splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    # only a symmetric permutation keeps the signs of the pivots
    if not np.array_equal(factors.perm_r, factors.perm_c):
        return
    below = int(np.count_nonzero(factors.U.diagonal() < 0.0))
    if below != last + 1:
        where = np.sqrt(max(between, 0.0)) / (2.0 * np.pi)
        raise SolverError(f"modes: {below} frequencies lie below {where:.6g} Hz, the eigensolver found {last + 1}")


def rediagonalise(stiffness: sp.csr_array, mass: sp.csr_array, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and mass-normalised combinations of the columns of `basis`, ascending.

    basis: shape (ndof, n), independent columns.
    """
    # equal diagonals first: constraint modes and normal modes differ by orders in their norm
    scaled = basis / np.sqrt(np.einsum("ij,ij->j", basis, mass @ basis))
    K, M = scaled.T @ (stiffness @ scaled), scaled.T @ (mass @ scaled)
    values, combination = scipy.linalg.eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    return values, scaled @ combination


def frequency(values: np.ndarray) -> np.ndarray:
    """Eigenvalues [rad^2/s^2] to Hz; the rounding noise of rigid modes may be negative and is shown by its size."""
    return np.sqrt(np.abs(values)) / (2.0 * np.pi)
