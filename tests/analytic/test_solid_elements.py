"""Solid elements against exact strains, volumes and scikit-fem; their factors against dense algebra and SciPy."""

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg
from skfem import Basis, ElementHex1, ElementTetP2, ElementVector, MeshHex, MeshTet2
from skfem.models.elasticity import lame_parameters, linear_elasticity

from flexclear.structure.fe.solid import elasticity, geometry
from flexclear.structure.fe.solid.elasticity import Solid
from flexclear.structure.fe.solid.elements import ELEMENTS, shape_functions
from flexclear.structure.fe.solid.geometry import Geometry, check
from flexclear.structure.kinds.kind import of_mesh
from flexclear.structure.sparse import Front, cholesky, dissect, negative_pivots
from flexclear.system.errors import InputError, SolverError
from tests.analytic.solid_models import block, build

LAME, SHEAR = lame_parameters(7.17e10, 0.33)


def distorted(element: str) -> tuple[np.ndarray, np.ndarray]:
    """A box of 2 x 2 x 2 cells whose inner corner is moved; straight edges."""
    nodes, cells = geometry.cut_cells(*geometry.box_cells((1.0, 0.8, 0.6), (2, 2, 2)), element)
    corner = np.abs(nodes - [0.5, 0.0, 0.0])
    hat = np.clip(1.0 - corner / [0.5, 0.4, 0.3], 0.0, None).prod(axis=1)
    return nodes + hat[:, None] * [0.07, -0.05, 0.06], cells


def solid(element: str, nodes: np.ndarray, cells: np.ndarray) -> Solid:
    one = np.ones(len(cells))
    return Solid(element, nodes, cells, LAME * one, SHEAR * one, 2740.0 * one)


@pytest.mark.parametrize("element", ELEMENTS)
def test_shape_functions_are_one_at_their_own_node(element: str) -> None:
    value, gradient = shape_functions(element, ELEMENTS[element].local.T)
    np.testing.assert_allclose(value, np.eye(len(value)), atol=1e-14)
    np.testing.assert_allclose(gradient.sum(axis=1), 0.0, atol=1e-12)


@pytest.mark.parametrize("element", ELEMENTS)
def test_linear_displacements_have_their_exact_energy_and_no_inner_forces(element: str) -> None:
    """The patch test on distorted cells: constant strain, forces on the boundary only."""
    nodes, cells = distorted(element)
    K = elasticity.stiffness(solid(element, nodes, cells))
    slope = np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.7, 0.2, 0.6]])
    u = (nodes @ slope.T).ravel()
    strain = 0.5 * (slope + slope.T)
    energy = 0.48 * (LAME * np.trace(strain) ** 2 + 2.0 * SHEAR * np.sum(strain**2))
    assert u @ K @ u == pytest.approx(energy, rel=1e-12)
    inside = np.all((nodes > [1e-9, -0.4 + 1e-9, -0.3 + 1e-9]) & (nodes < [1 - 1e-9, 0.4 - 1e-9, 0.3 - 1e-9]), axis=1)
    force = (K @ u).reshape(-1, 3)
    assert np.count_nonzero(inside) >= 1
    assert np.abs(force[inside]).max() < 1e-12 * np.abs(K.data).max()


@pytest.mark.parametrize("element", ["hex8", "tet10"])
def test_matrices_are_those_of_scikit_fem(element: str) -> None:
    """The same cells through scikit-fem's own mesh, mapping and weak form; eigenvalues do not know the order."""
    nodes, cells = distorted(element)
    if element == "hex8":
        # scikit-fem numbers the corners of a cube lexicographically
        mesh, basis_element = MeshHex(nodes.T.copy(), cells.T[[0, 3, 4, 1, 7, 2, 5, 6]].copy()), ElementHex1()
    else:
        mesh, basis_element = MeshTet2(nodes.T.copy(), cells.T[[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]].copy()), ElementTetP2()
    basis = Basis(mesh, ElementVector(basis_element), intorder=ELEMENTS[element].stiffness_order)
    theirs = linear_elasticity(LAME, SHEAR).assemble(basis).toarray()
    ours = elasticity.stiffness(solid(element, nodes, cells)).toarray()
    expected = np.linalg.eigvalsh(0.5 * (theirs + theirs.T))
    np.testing.assert_allclose(np.linalg.eigvalsh(ours), expected, rtol=0.0, atol=1e-12 * expected[-1])


@pytest.mark.parametrize("element", ELEMENTS)
def test_mass_is_that_of_the_volume(element: str) -> None:
    """A box to rounding; a cylinder as its quadratic sides let it: (quarter arc / 4)^4 / 90 or so of the area."""
    nodes, cells = geometry.cut_cells(*geometry.box_cells((0.3, 0.2, 0.1), (2, 1, 2)), element)
    assert elasticity.mass(solid(element, nodes, cells)).sum() == pytest.approx(2740.0 * 6e-3, rel=1e-13)
    nodes, cells = geometry.cut_cells(*geometry.cylinder(0.01, 0.05, 2, 4, 1), element)
    tolerance = {"hex8": 3e-2, "tet4": 2e-2}.get(element, 1e-4)
    exact = 2740.0 * np.pi * 1e-4 * 0.05
    assert elasticity.mass(solid(element, nodes, cells)).sum() == pytest.approx(exact, rel=tolerance)


def test_cells_that_are_inside_out_or_oddly_numbered_are_refused() -> None:
    nodes, cells = geometry.cut_cells(*geometry.box_cells((1.0, 1.0, 1.0), (2, 1, 1)), "hex8")
    wrong = cells.copy()
    wrong[1] = wrong[1, [4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(InputError, match=r"1 of 2 cells are inverted or flat .*: 1\n.*right-handed"):
        check(Geometry("hex8", nodes, wrong, {}, {}), "recipe")
    nodes, cells = geometry.box_cells((1.0, 1.0, 1.0), (2, 1, 1))
    wrong = cells.copy()
    wrong[:, [8, 9]] = wrong[:, [9, 8]]
    with pytest.raises(InputError, match=r"far from the middle of its corners.*\n.*node order"):
        check(Geometry("hex27", nodes, wrong, {}, {}), "recipe")


def test_a_body_in_two_pieces_is_refused() -> None:
    nodes, cells = geometry.cut_cells(*geometry.box_cells((1.0, 1.0, 1.0), (1, 1, 1)), "hex20")
    both = np.vstack([nodes, nodes + np.array([2.0, 0.0, 0.0])])
    with pytest.raises(InputError, match=r"in 2 pieces without common nodes \(of 1, 1 cells\)\n.*merge"):
        check(Geometry("hex20", both, np.vstack([cells, cells + len(nodes)]), {}, {}), "recipe")


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_drawn_boundary_is_closed_and_has_the_area_of_the_body(element: str) -> None:
    """Its pieces neither overlap nor leave a gap: each edge belongs to two, and their areas add up."""
    size = np.array([0.1, 0.02, 0.03])
    mesh = build(block(element, (3, 2, 2), tuple(size), "mean"))
    drawn = of_mesh(mesh).assemble(mesh).drawn
    edges = np.sort(np.stack([drawn.cell, np.roll(drawn.cell, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    corner = drawn.position[drawn.cell]
    spokes = corner[:, 1:] - corner[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(spokes[:, :-1], spokes[:, 1:]), axis=2).sum()
    assert area == pytest.approx(2.0 * (size * np.roll(size, 1)).sum(), rel=1e-12)


# Nested dissection and multifrontal factors --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clamped() -> tuple[sp.csr_array, np.ndarray]:
    """Stiffness of a box held at one end, and places of its rows; with a row that couples to a whole face."""
    nodes, cells = geometry.cut_cells(*geometry.box_cells((1.0, 0.6, 0.5), (7, 5, 4)), "hex20")
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


def test_what_a_child_hands_up_is_added_where_its_rows_are() -> None:
    rng = np.random.default_rng(11)
    k, rows = 6, 20
    for at in ([0, 1, 2, 5, 6, 7, 12, 13, 19], [3, 4, 5], [6, 8, 10, 11], list(range(rows)), [0, 2, 4, 19]):
        whole, theirs = rng.normal(size=(rows, rows)), rng.normal(size=(len(at), len(at)))
        front = Front(0, np.arange(k, rows), whole[:k, :k].copy(), whole[k:, :k].copy(), whole[k:, k:].copy())
        front.add(np.array(at), theirs)
        whole[np.ix_(at, at)] += theirs
        # one sum for each entry, so to the last bit
        np.testing.assert_array_equal(np.tril(front.diagonal), np.tril(whole[:k, :k]))
        np.testing.assert_array_equal(front.under, whole[k:, :k])
        np.testing.assert_array_equal(np.tril(front.rest), np.tril(whole[k:, k:]))


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
