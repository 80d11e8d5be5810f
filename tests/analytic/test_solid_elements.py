"""Solid elements: exact strains and volumes, scikit-fem's matrices, and refusal of cells that are no cells."""

import numpy as np
import pytest
from skfem import Basis, ElementHex1, ElementTetP2, ElementVector, MeshHex, MeshTet2
from skfem.models.elasticity import lame_parameters, linear_elasticity

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.solid import elasticity, lattice
from flexclear.pipeline.structure.fe.solid.elasticity import Solid
from flexclear.pipeline.structure.fe.solid.elements import ELEMENTS, shape_functions
from flexclear.pipeline.structure.fe.solid.geometry import Geometry, check
from flexclear.pipeline.structure.kinds.kind import of_mesh
from tests.analytic.solid_models import block, build

LAME, SHEAR = lame_parameters(7.17e10, 0.33)


def distorted(element: str) -> tuple[np.ndarray, np.ndarray]:
    """A box of 2 x 2 x 2 cells whose inner corner is moved; straight edges."""
    nodes, cells = lattice.cut(*lattice.block((1.0, 0.8, 0.6), (2, 2, 2)), element)
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
    nodes, cells = lattice.cut(*lattice.block((0.3, 0.2, 0.1), (2, 1, 2)), element)
    assert elasticity.mass(solid(element, nodes, cells)).sum() == pytest.approx(2740.0 * 6e-3, rel=1e-13)
    nodes, cells = lattice.cut(*lattice.cylinder(0.01, 0.05, 2, 4, 1), element)
    tolerance = {"hex8": 3e-2, "tet4": 2e-2}.get(element, 1e-4)
    exact = 2740.0 * np.pi * 1e-4 * 0.05
    assert elasticity.mass(solid(element, nodes, cells)).sum() == pytest.approx(exact, rel=tolerance)


def test_cells_that_are_inside_out_or_oddly_numbered_are_refused() -> None:
    nodes, cells = lattice.cut(*lattice.block((1.0, 1.0, 1.0), (2, 1, 1)), "hex8")
    wrong = cells.copy()
    wrong[1] = wrong[1, [4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(InputError, match=r"1 of 2 cells are inverted or flat .*: 1\n.*right-handed"):
        check(Geometry("hex8", nodes, wrong, {}, {}), "recipe")
    nodes, cells = lattice.block((1.0, 1.0, 1.0), (2, 1, 1))
    wrong = cells.copy()
    wrong[:, [8, 9]] = wrong[:, [9, 8]]
    with pytest.raises(InputError, match=r"far from the middle of its corners.*\n.*node order"):
        check(Geometry("hex27", nodes, wrong, {}, {}), "recipe")


def test_a_body_in_two_pieces_is_refused() -> None:
    nodes, cells = lattice.cut(*lattice.block((1.0, 1.0, 1.0), (1, 1, 1)), "hex20")
    both = np.vstack([nodes, nodes + np.array([2.0, 0.0, 0.0])])
    with pytest.raises(InputError, match=r"in 2 pieces that share no node \(of 1, 1 cells\)\n.*merge"):
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
