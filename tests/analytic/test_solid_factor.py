"""Nested dissection and the multifrontal factors against dense linear algebra and SciPy."""

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg

from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.structure.fe.solid import elasticity, lattice
from flexclear.pipeline.structure.fe.solid.elasticity import Solid
from flexclear.pipeline.structure.sparse.dissection import dissect
from flexclear.pipeline.structure.sparse.multifrontal import cholesky, negative_pivots


@pytest.fixture(scope="module")
def clamped() -> tuple[sp.csr_array, np.ndarray]:
    """Stiffness of a box held at one end, and places of its rows; with a row that couples to a whole face."""
    nodes, cells = lattice.cut(*lattice.block((1.0, 0.6, 0.5), (7, 5, 4)), "hex20")
    one = np.ones(len(cells))
    K = elasticity.stiffness(Solid("hex20", nodes, cells, one, one, one))
    free = np.flatnonzero(np.repeat(nodes[:, 0] > 0.0, 3))
    K, place = sp.csr_array(K[free][:, free]), np.repeat(nodes, 3, axis=0)[free]
    face = sp.csr_array((place[:, 0] > 1.0 - 1e-9).astype(float)[None, :])
    joined = sp.vstack([sp.hstack([K, 0.002 * face.T]), sp.hstack([0.002 * face, sp.csr_array(np.array([[3.0]]))])])
    return sp.csr_array(joined), np.vstack([place, [1.0, 0.0, 0.0]])


def test_the_tree_holds_every_row_once_and_children_come_first(clamped: tuple[sp.csr_array, np.ndarray]) -> None:
    K, place = clamped
    tree = dissect(K, place)
    np.testing.assert_array_equal(np.sort(tree.order), np.arange(len(place)))
    assert np.all(tree.parent > np.arange(len(tree.parent)))
    # no link between blocks but to ancestors
    block = np.empty(len(place), dtype=int)
    block[tree.order] = np.repeat(np.arange(len(tree.parent)), np.diff(tree.start))
    pairs = sp.coo_array(K)
    low, high = np.sort(np.stack([block[pairs.row], block[pairs.col]]), axis=0)
    for _ in range(len(tree.parent)):
        climbing = low < high
        low = np.where(climbing, np.append(tree.parent, len(tree.parent))[low], low)
    np.testing.assert_array_equal(low, high)


def test_solutions_are_those_of_superlu(clamped: tuple[sp.csr_array, np.ndarray]) -> None:
    K, place = clamped
    loads = np.random.default_rng(7).normal(size=(K.shape[0], 5))
    found = cholesky(K, place).solve(loads)
    expected = scipy.sparse.linalg.splu(K.tocsc()).solve(loads)
    # eps times the condition, 4.5e4, relative to the largest component, whatever the order of the sums; ten times that
    values = np.linalg.eigvalsh(K.toarray())
    rounding = 10.0 * np.finfo(float).eps * values[-1] / values[0]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=rounding * np.abs(expected).max())
    alone = cholesky(K, place).solve(loads[:, 0])
    np.testing.assert_allclose(alone, found[:, 0], rtol=0.0, atol=rounding * np.abs(alone).max())


def test_negative_eigenvalues_are_counted(clamped: tuple[sp.csr_array, np.ndarray]) -> None:
    K, place = clamped
    values = np.linalg.eigvalsh(K.toarray())
    for shift in (0.5 * values[0], 0.5 * (values[4] + values[5]), values.mean(), 2.0 * values[-1]):
        assert negative_pivots(sp.csr_array(K - shift * sp.eye_array(len(place))), place) == np.sum(values < shift)


def test_rows_without_a_diagonal_come_last(clamped: tuple[sp.csr_array, np.ndarray]) -> None:
    """Two functionals as a border: as many eigenvalues of either sign come on top."""
    K, place = clamped
    C = sp.csr_array(np.random.default_rng(3).normal(size=(2, K.shape[0])))
    bordered = sp.csr_array(sp.vstack([sp.hstack([K, C.T]), sp.hstack([C, sp.csr_array((2, 2))])]))
    assert negative_pivots(bordered, np.vstack([place, np.zeros((2, 3))]), 2) == 2


def test_a_matrix_that_is_not_positive_definite_is_refused(clamped: tuple[sp.csr_array, np.ndarray]) -> None:
    K, place = clamped
    with pytest.raises(SolverError, match="not positive definite"):
        cholesky(sp.csr_array(K - 10.0 * sp.eye_array(len(place))), place)


def test_factors_stay_small(clamped: tuple[sp.csr_array, np.ndarray]) -> None:
    """No more than a third above what SuperLU's minimum degree order needs; a profile order needs 2.6 times as much."""
    K, place = clamped
    theirs = scipy.sparse.linalg.splu(
        K.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    # SuperLU's own count differs by 4 % among processors, since it pivots
    entries = sum(block.diagonal.size + block.under.size for block in cholesky(K, place).blocks)
    assert entries < 1.6 * theirs.L.nnz
