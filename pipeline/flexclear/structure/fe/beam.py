r"""Two-node spatial beam elements: stiffness and mass of a rod of any section, theory and position.

.. math:: 2U = \int EA\,u'^2 + GJ\,\varphi'^2 + E(I_z \psi_v'^2 + I_y \psi_w'^2 + 2I_{yz}\psi_v'\psi_w')
               + \kappa_y GA\gamma_y^2 + \kappa_z GA\gamma_z^2 ,\qquad
          2T = \int \rho A(\dot u^2+\dot v^2+\dot w^2) + \rho I_p\dot\varphi^2
               + \rho (I_z \dot\psi_v^2 + I_y \dot\psi_w^2 + 2I_{yz}\dot\psi_v\dot\psi_w)

Without shear deformation (Euler-Bernoulli, Rayleigh) the section's slope is that of the axis, :math:`\psi = v'`,
and deflections are Hermite cubics (see below). Extension and twist are linear or quadratic in a
cell. Sections that change along a cell are integrated at its Gauss points.
Source: Wang & Wang (2019), sec. 3.2 (12-dof spatial beam elements); Przemieniecki (1968), ch. 5 and 11.

Vectors are ordered node by node, ux uy uz rx ry rz in axes of the mesh frame (for a rod along x: rz = dv/dx,
ry = -dw/dx); the unknowns inside the cells come after all nodes and are zero in every rigid motion.

Kinematics of cross sections: the fields of a cell, their strains, and the motion of the section.

Bernoulli (Euler-Bernoulli and Rayleigh beams): sections stay normal to the axis; deflections are Hermite cubics.
Timoshenko: sections turn by :math:`\psi` on their own, shear strain :math:`\gamma = v' - \psi`. Deflections are
cubic and rotations quadratic, so that :math:`v'` and :math:`\psi` span the same polynomials: slender cells do not lock
(as :math:`\gamma\to 0` the Hermite cubics remain), and frequencies converge with the fourth power of the cell
length.
Without the unknowns inside, condensed statically as in the elements with interdependent interpolation, the shear strain
of a cell is constant, and frequencies converge with the second power only.

Both have the same unknowns at a node: u, twist, v, slope of v, w, slope of w. Unknowns inside a cell are extra.
Source: Reddy (1997), Comput. Methods Appl. Mech. Eng. 149, 113-132 (interdependent interpolation, consistency of
degrees); Przemieniecki (1968), ch. 5 and 11.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
import xarray as xr
from skfem import Basis, BilinearForm, ElementComposite, MeshLine
from skfem.element.discrete_field import DiscreteField
from skfem.element.element import Element
from skfem.element.element_h1 import ElementH1
from skfem.refdom import RefLine

from flexclear.structure.fe.model import DOFS, rigid_displacements, rigid_motions, selection, symmetric_part
from flexclear.structure.fe.section import POINTS, WEIGHTS

#: unknowns of a node in scikit-fem's order, as indices of ux uy uz rx ry rz, with sign: ry = -slope of w
NODE_COMPONENT = (0, 3, 1, 5, 2, 4)
NODE_SIGN = (1.0, 1.0, 1.0, 1.0, 1.0, -1.0)


#: ascending power coefficients on [0, 1] of: value at 0, slope at 0, value at 1, slope at 1
HERMITE = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])


class LocalHermite(Element):
    """Cubic Hermite element with nodal unknowns u and du/dx, evaluated in the cell's own coordinate.

    scikit-fem's `ElementLineHermite` inverts a Vandermonde matrix in global coordinates: the stiffness is wrong by
    3e-11 (12 cells), 5e-9 (64) and 5e-7 (256) relative on a rod that starts at the origin, and a second mesh silently
    reuses the first one's inverse. This element is exact to rounding and stores nothing between calls.
    """

    nodal_dofs = 2
    maxdeg = 3
    dofnames: ClassVar[list[str]] = ["u", "u_x"]
    doflocs = np.array([[0.0], [0.0], [1.0], [1.0]])
    refdom = RefLine

    def gbasis(self, mapping: Any, X: np.ndarray, i: int, tind: np.ndarray | None = None) -> tuple[DiscreteField]:
        """Return basis function i with its first and second derivative at local points X, shape (1, points)."""
        h = mapping.detDF(X, tind)  # (cells, points): the signed length of each cell
        scale = np.ones_like(h) if i % 2 == 0 else h
        s = np.broadcast_to(X[0], h.shape)
        value, slope, curvature = (_polynomial_at(HERMITE[i], s, order) for order in range(3))
        return (
            DiscreteField(
                value=scale * value,
                grad=(scale * slope / h)[None],
                hess=(scale * curvature / h**2)[None, None],
            ),
        )


#: ascending power coefficients on [0, 1]: the two nodal functions, then the bubbles 4 s (1-s) and 8 s (1-s) (2s-1)
BUBBLES = (
    np.array([1.0, -1.0]),
    np.array([0.0, 1.0]),
    np.array([0.0, 4.0, -4.0]),
    np.array([0.0, -8.0, 24.0, -16.0]),
)


class Hierarchical(ElementH1):
    """Continuous element of degree one to three: nodal values, and `degree` - 1 bubbles that vanish at both ends.

    A field that is linear along the rod, as in every rigid motion, then depends on its nodal values alone.
    scikit-fem's own hierarchical element stores the values of its last call; this one stores nothing.
    """

    nodal_dofs = 1
    refdom = RefLine

    def __init__(self, degree: int) -> None:
        self.interior_dofs = degree - 1
        self.maxdeg = degree
        self.dofnames = ["u"] + ["bubble"] * (degree - 1)
        self.doflocs = np.array([[0.0], [1.0]] + [[np.nan]] * (degree - 1))

    def lbasis(self, X: np.ndarray, i: int) -> tuple[Any, Any]:
        """Return function i and its derivative at local points X, shape (1, points)."""
        return _polynomial_at(BUBBLES[i], X[0]), _polynomial_at(BUBBLES[i], X[0], 1)[None]


def _polynomial_at(coefficients: np.ndarray, s: np.ndarray, order: int = 0) -> np.ndarray:
    return np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(coefficients, order))


@dataclass(frozen=True)
class Kinematics:
    """Kinematics of one beam theory.

    elements: elements of the fields, from the degrees of extension and twist.
    component: index of each field among ux uy uz rx ry rz.
    strains: strains by name, from the fields.  section: (u, v, w) and (twist, slope of v, slope of w), from the fields.
    """

    elements: Callable[[int, int], list[Element]]
    component: tuple[int, ...]
    strains: Callable[..., dict[str, Any]]
    section: Callable[..., tuple[tuple[Any, ...], tuple[Any, ...]]]


BERNOULLI = Kinematics(
    elements=lambda extension, twist: [Hierarchical(extension), Hierarchical(twist), LocalHermite(), LocalHermite()],
    component=(0, 3, 1, 2),
    strains=lambda u, t, v, w: _strains(u, t, v.hess[0][0], w.hess[0][0]),
    section=lambda u, t, v, w: ((u, v, w), (t, v.grad[0], w.grad[0])),
)
TIMOSHENKO = Kinematics(
    elements=lambda extension, twist: [Hierarchical(degree) for degree in (extension, twist, 3, 2, 3, 2)],
    component=(0, 3, 1, 5, 2, 4),
    strains=lambda u, t, v, a, w, b: (
        _strains(u, t, a.grad[0], b.grad[0]) | {"shear_v": v.grad[0] - a, "shear_w": w.grad[0] - b}
    ),
    section=lambda u, t, v, a, w, b: ((u, v, w), (t, a, b)),
)


def _strains(u: Any, t: Any, bend_v: Any, bend_w: Any) -> dict[str, Any]:
    return {"stretch": u.grad[0], "twist": t.grad[0], "bend_v": bend_v, "bend_w": bend_w}


#: kinematics by the recipe's name of the theory; Euler-Bernoulli and Rayleigh differ in the mass alone
THEORIES = {"euler-bernoulli": BERNOULLI, "rayleigh": BERNOULLI, "timoshenko": TIMOSHENKO}


#: degrees of freedom of a node, in the order of every vector
N_DOFS = len(DOFS)
#: degree of extension and twist in a cell, by the recipe's word
DEGREE = {"linear": 1, "quadratic": 2}


@dataclass(frozen=True)
class Beam:
    """Stiffness and mass of a free beam, shape (ndof, ndof), with the data that field evaluation needs."""

    stiffness: sp.csr_array
    mass: sp.csr_array
    kinematics: Kinematics
    basis: Basis
    to_fields: sp.csr_array  #: from a vector to scikit-fem's order, rod axes and slopes, shape (ndof, ndof)
    node_position: np.ndarray  #: [m], mesh frame, shape (nodes, 3)
    axes: np.ndarray  #: R_MR, rod axes (x along the rod) to mesh frame, shape (3, 3)
    component: np.ndarray  #: index in DOFS of each unknown, in rod axes, shape (ndof,)
    along: np.ndarray  #: position of each unknown along the rod [m], shape (ndof,)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.shape[0]

    @property
    def nodal_size(self) -> int:
        """Number of degrees of freedom of the nodes, which open every vector."""
        return N_DOFS * len(self.node_position)


def assemble(mesh: xr.Dataset) -> Beam:
    """Assemble the matrices of a beam mesh (schema MESH)."""
    kinematics = THEORIES[mesh.attrs["theory"]]
    basis = _basis(mesh, kinematics)
    axes = mesh["rod_rotation"].values
    component, along, order = _unknowns(mesh, basis, kinematics)
    to_fields = order @ _to_rod_axes(axes, mesh.sizes["node"], len(component))
    K = _in_vector_order(_form(kinematics, _strain_energy).assemble(basis, **stiffness(mesh)), to_fields)
    M = _in_vector_order(_form(kinematics, _kinetic_energy).assemble(basis, **_inertia(mesh)), to_fields)
    mass = sp.csr_array(M + _lumped_mass(mesh, len(component)))
    return Beam(K, mass, kinematics, basis, to_fields, mesh["node_position"].values, axes, component, along)


def rigid_vectors(beam: Beam, about: np.ndarray | None = None) -> np.ndarray:
    """Return three translations and three rotations about a point, by default the mesh origin, shape (ndof, 6)."""
    inside = beam.size - beam.nodal_size
    positions = np.concatenate([np.repeat(beam.node_position, N_DOFS, axis=0), np.zeros((inside, 3))])
    component = np.append(np.tile(np.arange(N_DOFS), len(beam.node_position)), np.full(inside, N_DOFS))
    return rigid_motions(positions, component, np.zeros(3) if about is None else about)


def node_dofs(nodes: np.ndarray) -> np.ndarray:
    """Return the indices of all degrees of freedom of the nodes, in the order of the nodes."""
    return (N_DOFS * np.asarray(nodes)[:, None] + np.arange(N_DOFS)).ravel()


def in_rod_axes(beam: Beam, vectors: Any) -> Any:
    """Return vectors, dense or sparse of shape (ndof, n), with the nodes' components turned to rod axes."""
    return _to_rod_axes(beam.axes, len(beam.node_position), beam.size) @ vectors


def at_points(mesh: xr.Dataset, name: str) -> np.ndarray:
    """Return a section constant at the Gauss points, shape (cells, points) or (cells, points, 3)."""
    values = mesh[name].values[:, None]
    profile = f"{name}_profile"
    if profile in mesh:
        return values * mesh[profile].values
    return np.broadcast_to(values, (values.shape[0], len(POINTS), *values.shape[2:]))


def per_point(mesh: xr.Dataset, name: str) -> np.ndarray:
    """Return a cell constant at the Gauss points, shape (cells, points); zero where the mesh has no such constant."""
    if name not in mesh:
        return np.zeros((mesh.sizes["cell"], len(POINTS)))
    return np.repeat(mesh[name].values[:, None], len(POINTS), axis=1)


def stiffness(mesh: xr.Dataset) -> dict[str, np.ndarray]:
    """Return the section's stiffness to each strain at the Gauss points, shape (cells, points)."""
    E, G = per_point(mesh, "youngs_modulus"), per_point(mesh, "shear_modulus")
    area, second = at_points(mesh, "area"), at_points(mesh, "second_moment")
    matrices = {
        "stretch": E * area,
        "twist": G * second[..., 0],
        "bend_w": E * second[..., 1],
        "bend_v": E * second[..., 2],
        "bend_both": E * per_point(mesh, "product_moment"),
    }
    if mesh.attrs["theory"] == "timoshenko":
        fraction = at_points(mesh, "shear_coefficient")
        matrices |= {"shear_v": G * area * fraction[..., 1], "shear_w": G * area * fraction[..., 2]}
    return matrices


def _inertia(mesh: xr.Dataset) -> dict[str, np.ndarray]:
    rho, rotary = per_point(mesh, "density"), at_points(mesh, "inertia_moment")
    return {
        "line": rho * at_points(mesh, "area"),
        "twist": rho * rotary[..., 0],
        "slope_w": rho * rotary[..., 1],
        "slope_v": rho * rotary[..., 2],
        "slope_both": rho * per_point(mesh, "inertia_product"),
    }


def _form(kinematics: Kinematics, density: Any) -> BilinearForm:
    """Return the bilinear form of an energy density of trial and test fields."""
    n = len(kinematics.component)
    return BilinearForm(lambda *a: density(kinematics, a[:n], a[n : 2 * n], a[2 * n]))


def _strain_energy(kinematics: Kinematics, trial: Any, test: Any, p: Any) -> Any:
    a, b = kinematics.strains(*trial), kinematics.strains(*test)
    coupled = a["bend_v"] * b["bend_w"] + a["bend_w"] * b["bend_v"]
    return sum(p[name] * a[name] * b[name] for name in a) + p["bend_both"] * coupled


def _kinetic_energy(kinematics: Kinematics, trial: Any, test: Any, p: Any) -> Any:
    (s, (t, v, w)), (ds, (dt, dv, dw)) = kinematics.section(*trial), kinematics.section(*test)
    translation = p["line"] * sum(x * dx for x, dx in zip(s, ds, strict=True))
    slopes = p["slope_v"] * v * dv + p["slope_w"] * w * dw + p["slope_both"] * (v * dw + w * dv)
    return translation + p["twist"] * t * dt + slopes


def _basis(mesh: xr.Dataset, kinematics: Kinematics) -> Basis:
    # measured from the rod's own start: far from the mesh origin cell lengths would lose digits
    line = MeshLine(mesh["abscissa"].values[None, :].copy(), mesh["cell_node"].values.T.copy())
    extension, twist = (DEGREE[mesh.attrs[name]] for name in ("extension", "torsion"))
    element = ElementComposite(*kinematics.elements(extension, twist))
    return Basis(line, element, quadrature=(POINTS[None, :], WEIGHTS))


def _unknowns(mesh: xr.Dataset, basis: Basis, kinematics: Kinematics) -> tuple[np.ndarray, np.ndarray, sp.csr_array]:
    """Return component and position of each unknown, and the signed permutation from vectors to scikit-fem's order."""
    x, cells = mesh["abscissa"].values, mesh["cell_node"].values
    by_node = np.argsort(NODE_COMPONENT)
    nodal = basis.nodal_dofs[by_node].T.ravel()
    inside = [c for e, c in zip(basis.elem.elems, kinematics.component, strict=True) for _ in range(e.interior_dofs)]
    interior = basis.interior_dofs.T.ravel() if inside else np.empty(0, dtype=int)
    rows = np.concatenate([nodal, interior])
    component = np.concatenate([np.tile(np.arange(N_DOFS), len(x)), np.tile(np.array(inside, dtype=int), len(cells))])
    along = np.concatenate([np.repeat(x, N_DOFS), np.repeat(x[cells].mean(axis=1), len(inside))])
    signs = np.where(component == 4, NODE_SIGN[-1], 1.0)
    order = sp.csr_array((signs, (rows, np.arange(rows.size))), shape=(rows.size, rows.size))
    return component, along, order


def _to_rod_axes(axes: np.ndarray, nodes: int, size: int) -> sp.csr_array:
    turn = sp.kron(sp.eye_array(2 * nodes), axes.T)
    return sp.csr_array(sp.block_diag([turn, sp.eye_array(size - N_DOFS * nodes)]))


def _lumped_mass(mesh: xr.Dataset, size: int) -> sp.csr_array:
    """Return the mass matrix of lumped masses: with the offset r of the centre of mass, v = u + theta x r."""
    if "lump_node" not in mesh:
        return sp.csr_array((size, size))
    motion, m = rigid_displacements(mesh["lump_offset"].values), mesh["lump_mass"].values
    blocks = m[:, None, None] * motion.transpose(0, 2, 1) @ motion
    blocks[:, 3:, 3:] += mesh["lump_inertia"].values
    nodes = selection(node_dofs(mesh["lump_node"].values), size)
    return sp.csr_array(nodes.T @ sp.block_diag(list(blocks)) @ nodes)


def _in_vector_order(matrix: Any, to_fields: sp.csr_array) -> sp.csr_array:
    return symmetric_part(to_fields.T @ sp.csr_array(matrix) @ to_fields)
