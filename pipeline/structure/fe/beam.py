r"""Spatial Euler-Bernoulli beams of two nodes and twelve degrees of freedom.

Axial and twist linear, deflections cubic; consistent mass with rotary inertia (Rayleigh):

.. math:: 2U = \int EA\,u'^2 + GJ\,\varphi'^2 + EI_z v''^2 + EI_y w''^2 ,\qquad
          2T = \int \rho A(\dot u^2+\dot v^2+\dot w^2) + \rho I_p\dot\varphi^2 + \rho I_z \dot v'^2 + \rho I_y \dot w'^2

Source: Wang & Wang (2019), sec. 3.2 (12-dof spatial beam elements); Przemieniecki (1968), ch. 5 and 11.
Vectors are ordered node by node: ux uy uz rx ry rz, with rz = dv/dx and ry = -dw/dx.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import xarray as xr
from skfem import Basis, BilinearForm, ElementComposite, ElementLineP1, MeshLine

from pipeline.structure.fe.hermite import LocalHermite

#: degrees of freedom of a node, in the order of every vector
DOFS = ("ux", "uy", "uz", "rx", "ry", "rz")
N_DOFS = len(DOFS)

#: cubic times cubic, the highest product of the mass
INTEGRATION_ORDER = 6


@dataclass(frozen=True)
class Beam:
    """Stiffness and mass of a free beam, shape (ndof, ndof), and what field evaluation needs.

    `to_fields` maps a vector in node order to scikit-fem's order and slopes, shape (ndof, ndof).
    """

    stiffness: sp.csr_array
    mass: sp.csr_array
    basis: Basis
    to_fields: sp.csr_array
    node_position: np.ndarray  #: [m], shape (nodes, 3)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.shape[0]


@dataclass(frozen=True)
class Motion:
    """Motion of the sections at the quadrature points per unit of each vector.

    weight: ds [m], shape (cells, points).  x: place [m], likewise.
    translation: of the axis [1], rotation: of the section [rad/m], shape (3, cells, points, vectors).
    """

    weight: np.ndarray
    x: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray


def assemble(mesh: xr.Dataset) -> Beam:
    """Matrices of a mesh (schema MESH) whose cells lie along x."""
    basis = _basis(mesh)
    to_fields = _node_order(basis)
    points = basis.dx.shape
    second, rotary = mesh["second_moment"].values, mesh["inertia_moment"].values
    E, G, rho, A = (mesh[name].values for name in ("youngs_modulus", "shear_modulus", "density", "area"))
    stiffness = {"axial": E * A, "twist": G * second[:, 0], "about_y": E * second[:, 1], "about_z": E * second[:, 2]}
    twist, about_y, about_z = rho * rotary.T
    mass = {"line": rho * A, "twist": twist, "about_y": about_y, "about_z": about_z}
    K = _stiffness.assemble(basis, **_at_points(stiffness, points))
    M = _mass.assemble(basis, **_at_points(mass, points))
    return Beam(
        _in_node_order(K, to_fields), _in_node_order(M, to_fields), basis, to_fields, mesh["node_position"].values
    )


@BilinearForm
def _stiffness(u: Any, t: Any, v: Any, w: Any, du: Any, dt: Any, dv: Any, dw: Any, p: Any) -> Any:
    stretch = p["axial"] * u.grad[0] * du.grad[0] + p["twist"] * t.grad[0] * dt.grad[0]
    return stretch + p["about_z"] * v.hess[0][0] * dv.hess[0][0] + p["about_y"] * w.hess[0][0] * dw.hess[0][0]


@BilinearForm
def _mass(u: Any, t: Any, v: Any, w: Any, du: Any, dt: Any, dv: Any, dw: Any, p: Any) -> Any:
    translation = p["line"] * (u * du + v * dv + w * dw)
    slopes = p["about_z"] * v.grad[0] * dv.grad[0] + p["about_y"] * w.grad[0] * dw.grad[0]
    return translation + p["twist"] * t * dt + slopes


def section_motion(beam: Beam, vectors: np.ndarray) -> Motion:
    """Section motion for vectors in node order, shape (ndof, n), at points that integrate products exactly."""
    fields = [beam.basis.interpolate(column) for column in (beam.to_fields @ vectors).T]
    translation = [(u, v, w) for u, _, v, w in fields]
    rotation = [(t, -w.grad[0], v.grad[0]) for _, t, v, w in fields]
    x = np.asarray(beam.basis.global_coordinates())[0]
    axes = (1, 2, 3, 0)
    return Motion(beam.basis.dx, x, np.array(translation).transpose(axes), np.array(rotation).transpose(axes))


def rigid_vectors(beam: Beam) -> np.ndarray:
    """Three translations and three rotations about the mesh origin, shape (ndof, 6)."""
    x = beam.node_position[:, 0]
    vectors = np.zeros((len(x), N_DOFS, 6))
    vectors[:, range(6), range(6)] = 1.0
    vectors[:, 2, 4] = -x  # about y: w falls along x
    vectors[:, 1, 5] = x
    return vectors.reshape(-1, 6)


def node_dofs(nodes: np.ndarray) -> np.ndarray:
    """Indices of all degrees of freedom of the nodes, in their order."""
    return (N_DOFS * np.asarray(nodes)[:, None] + np.arange(N_DOFS)).ravel()


def _basis(mesh: xr.Dataset) -> Basis:
    x = np.ascontiguousarray(mesh["node_position"].values[:, 0])
    line = MeshLine(x[None, :], mesh["cell"].values.T.copy())
    element = ElementComposite(ElementLineP1(), ElementLineP1(), LocalHermite(), LocalHermite())
    # the composite's own degree would be the sum of its parts
    return Basis(line, element, intorder=INTEGRATION_ORDER)


def _node_order(basis: Basis) -> sp.csr_array:
    """Signed permutation from node order to scikit-fem's: rows are u, twist, v, dv/dx, w, dw/dx of each node."""
    u, twist, v, v_x, w, w_x = basis.nodal_dofs
    rows = np.stack([u, v, w, twist, w_x, v_x], axis=1).ravel()
    signs = np.tile([1.0, 1.0, 1.0, 1.0, -1.0, 1.0], basis.nodal_dofs.shape[1])
    return sp.csr_array((signs, (rows, np.arange(rows.size))), shape=(rows.size, rows.size))


def _in_node_order(matrix: Any, to_fields: sp.csr_array) -> sp.csr_array:
    result = to_fields.T @ sp.csr_array(matrix) @ to_fields
    # quadrature sums in another order above and below the diagonal; exact symmetry is what eigensolvers expect
    return sp.csr_array(0.5 * (result + result.T))


def _at_points(per_cell: dict[str, np.ndarray], shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    return {name: np.broadcast_to(value[:, None], shape) for name, value in per_cell.items()}
