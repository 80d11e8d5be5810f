"""Cholesky factors of a large sparse matrix by dense blocks along an elimination tree.

Each block of the tree gathers its rows and what its children left over in one dense matrix, eliminates its own
unknowns there with LAPACK, and hands the rest to its parent.
Source: Duff & Reid (1983), ACM Trans. Math. Softw. 9, 302-325; Liu (1992), SIAM Review 34, 82-109.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas, lapack

from flexclear.pipeline.core.errors import SolverError
from flexclear.pipeline.structure.sparse.dissection import Tree, dissect

Tell = Callable[[float], None]


@dataclass(frozen=True)
class Block:
    """Columns of the factor: own rows [start, stop) in elimination order, `below` the rows under them."""

    start: int
    stop: int
    below: np.ndarray
    diagonal: np.ndarray  #: lower triangle, shape (stop - start, stop - start)
    under: np.ndarray  #: shape (len(below), stop - start)


@dataclass(frozen=True)
class Factor:
    """Cholesky factor of a symmetric positive definite matrix."""

    order: np.ndarray
    blocks: tuple[Block, ...]

    @property
    def entries(self) -> int:
        """Stored numbers."""
        return sum(block.diagonal.size + block.under.size for block in self.blocks)

    def smallest_pivot(self, diagonal: np.ndarray) -> float:
        """Least pivot as a share of the matrix' own `diagonal`, shape (n,); rounding when the matrix is singular."""
        pivots = np.concatenate([np.diag(block.diagonal) for block in self.blocks]) ** 2
        return float((pivots / diagonal[self.order]).min())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solution for right-hand sides of shape (n,) or (n, m)."""
        x = np.asfortranarray(right[self.order].reshape(len(self.order), -1), dtype=float)
        for block in self.blocks:
            own = blas.dtrsm(1.0, block.diagonal, x[block.start : block.stop], lower=1)
            x[block.start : block.stop] = own
            if len(block.below):
                x[block.below] -= block.under @ own
        for block in reversed(self.blocks):
            own = x[block.start : block.stop]
            if len(block.below):
                own = own - block.under.T @ x[block.below]
            x[block.start : block.stop] = blas.dtrsm(1.0, block.diagonal, own, lower=1, trans_a=1)
        result = np.empty_like(x)
        result[self.order] = x
        return result.reshape(right.shape)


def cholesky(matrix: sp.csr_array, place: np.ndarray, tell: Tell = lambda share: None) -> Factor:
    """Factor of a symmetric positive definite matrix, shape (n, n).

    place: where each row belongs [m], shape (n, 3); it decides the order of elimination only.
    tell: is told the done share.  Raises SolverError when the matrix is not positive definite.
    """
    tree = dissect(matrix, place)
    blocks = []
    for front, k, start, below in _fronts(matrix, tree, tell):
        diagonal, info = lapack.dpotrf(front[:k, :k], lower=1, clean=1)
        if info != 0:
            raise SolverError(f"modes: a matrix of {len(tree.order)} rows is not positive definite")
        under = blas.dtrsm(1.0, diagonal, front[k:, :k], side=1, lower=1, trans_a=1)
        if len(below):
            front[k:, k:] = blas.dsyrk(-1.0, under, beta=1.0, c=front[k:, k:], lower=1)
        blocks.append(Block(start, start + k, below, diagonal, under))
    return Factor(tree.order, tuple(blocks))


def negative_pivots(matrix: sp.csr_array, place: np.ndarray, last: int = 0, tell: Tell = lambda share: None) -> int:
    """Number of negative eigenvalues of a symmetric matrix, by Sylvester's law of inertia.

    last: this many last rows are eliminated last, since they have no diagonal entry of their own.
    """
    tree = dissect(matrix, place, last)
    count = 0
    for front, k, _, below in _fronts(matrix, tree, tell):
        count += _eliminate(front, k, len(below))
    return count


def _eliminate(front: np.ndarray, k: int, rest: int) -> int:
    """Eliminate the first k unknowns in place and count their negative pivots."""
    diagonal, info = lapack.dpotrf(front[:k, :k], lower=1)
    if info == 0:
        if rest:
            under = blas.dtrsm(1.0, diagonal, front[k:, :k], side=1, lower=1, trans_a=1)
            front[k:, k:] = blas.dsyrk(-1.0, under, beta=1.0, c=front[k:, k:], lower=1)
        return 0
    factor, pivots, _ = lapack.dsytrf(front[:k, :k], lower=1)
    if rest:
        solved, _ = lapack.dsytrs(factor, pivots, front[k:, :k].T, lower=1)
        front[k:, k:] -= front[k:, :k] @ solved
    # a two by two pivot has one eigenvalue of each sign (Bunch & Kaufman 1977)
    return int(np.count_nonzero(np.diag(factor)[pivots > 0] < 0.0)) + int(np.count_nonzero(pivots < 0)) // 2


def _fronts(matrix: sp.csr_array, tree: Tree, tell: Tell) -> Iterator[tuple[np.ndarray, int, int, np.ndarray]]:
    """Each dense block in turn: matrix, own unknowns, first position, rows below; the caller eliminates in place.

    Only the lower triangle is filled.
    """
    n = len(tree.order)
    lower = sp.csc_array(sp.tril(sp.csr_array(matrix[tree.order][:, tree.order]), format="csc"))
    local = np.empty(n, dtype=np.int64)
    count = len(tree.parent)
    left: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in range(count + 1)]
    work = np.cumsum(np.diff(tree.start).astype(float) ** 2)
    for index in range(count):
        start, stop = int(tree.start[index]), int(tree.start[index + 1])
        first, last = lower.indptr[start], lower.indptr[stop]
        rows = lower.indices[first:last]
        inherited = [below for below, _ in left[index]]
        reached = np.unique(np.concatenate([rows, *inherited]))
        below = reached[reached >= stop]
        k, m = stop - start, stop - start + len(below)
        local[start:stop], local[below] = np.arange(k), np.arange(k, m)
        front = np.zeros((m, m), order="F")
        columns = np.repeat(np.arange(k), np.diff(lower.indptr[start : stop + 1]))
        front[local[rows], columns] = lower.data[first:last]
        for theirs, rest in left[index]:
            at = local[theirs]
            front[np.ix_(at, at)] += rest
        left[index] = []
        if k:
            yield front, k, start, below
        if len(below):
            left[tree.parent[index]].append((below, np.array(front[k:, k:], order="F")))
        tell(float(work[index] / work[-1]))
