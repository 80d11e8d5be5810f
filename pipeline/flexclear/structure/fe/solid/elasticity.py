r"""Stiffness and mass of isotropic solids, evaluated for many cells together.

.. math:: 2U = \int \lambda (\nabla\cdot u)^2 + 2\mu\,\varepsilon:\varepsilon\,dV, \qquad
          2T = \int \rho\,\dot u\cdot\dot u\,dV

With :math:`D_{ai,bj} = \int \partial_i N_a\,\partial_j N_b`, the stiffness of nodes a, b is

.. math:: \lambda D_{ai,bj} + \mu D_{aj,bi} + \mu\,\delta_{ij} D_{ak,bk},

one product of matrices per cell instead of a form for each pair of unknowns.
Source: Hughes, *The Finite Element Method* (2000), ch. 2 and 3 (isoparametric elements).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from flexclear.structure.fe.model import symmetric_part
from flexclear.structure.fe.solid.elements import ELEMENTS, Sampled, sample_element
from flexclear.system.errors import InputError

#: numbers of cell matrices that are evaluated together; bounds the memory
AT_ONCE = 20_000_000


@dataclass(frozen=True)
class Solid:
    """Nodes [m] (n, 3), cells (c, nodes) of one element type, Lame's lambda, mu [Pa] and rho [kg/m^3] of each cell."""

    element: str
    nodes: np.ndarray
    cells: np.ndarray
    lame: np.ndarray
    shear: np.ndarray
    density: np.ndarray


def stiffness(solid: Solid) -> sp.csr_array:
    """Return the stiffness of all nodes, x y z of each in turn, shape (3 n, 3 n)."""
    at = sample_element(solid.element, ELEMENTS[solid.element].stiffness_order)
    (pairs, indices, indptr), n = _pattern(solid), len(solid.nodes)
    data = np.zeros((len(indices), 3, 3))
    for part in chunks(solid, at):
        weight, gradient = gradients(solid, part, at)
        c, q, a, _ = gradient.shape
        flat = gradient.reshape(c, q, 3 * a)
        D = (flat * weight[..., None]).transpose(0, 2, 1) @ flat
        D = D.reshape(c, a, 3, a, 3)
        lame, shear = (values[part][:, None, None, None, None] for values in (solid.lame, solid.shear))
        K = lame * D + shear * D.transpose(0, 1, 4, 3, 2)
        trace = shear[..., 0, 0] * np.einsum("cakbk->cab", D)
        for i in range(3):
            K[:, :, i, :, i] += trace
        index = pairs[part].ravel()
        for i in range(3):
            for j in range(3):
                data[:, i, j] += np.bincount(index, K[:, :, i, :, j].ravel(), minlength=len(data))
    blocks = sp.bsr_array((data, indices, indptr), shape=(3 * n, 3 * n))
    return symmetric_part(blocks.tocsr())


def mass(solid: Solid) -> sp.csr_array:
    """Return the mass of the nodes for motion along one axis [kg], shape (n, n)."""
    at = sample_element(solid.element, ELEMENTS[solid.element].mass_order)
    (pairs, indices, indptr), n = _pattern(solid), len(solid.nodes)
    products = np.einsum("qa,qb->qab", at.value, at.value).reshape(len(at.weight), -1)
    data = np.zeros(len(indices))
    for part in chunks(solid, at):
        weight = _jacobian(solid, part, at)[0] * at.weight * solid.density[part][:, None]
        index = pairs[part].ravel()
        data += np.bincount(index, (weight @ products).ravel(), minlength=len(data))
    return symmetric_part(sp.csr_array((data, indices, indptr), shape=(n, n)))


def stress_stiffness(solid: Solid, displacement: np.ndarray) -> sp.csr_array:
    r"""Return :math:`\int\sigma_{ij}\,\partial_i N_a\,\partial_j N_b` [N/m] of a displacement's stress, shape (n, n).

    displacement: of the nodes [m], shape (n, 3).
    """
    at = sample_element(solid.element, ELEMENTS[solid.element].stiffness_order)
    (pairs, indices, indptr), n = _pattern(solid), len(solid.nodes)
    data = np.zeros(len(indices))
    for part in chunks(solid, at):
        weight, gradient = gradients(solid, part, at)
        slope = np.einsum("cak,cqai->cqik", displacement[solid.cells[part]], gradient, optimize=True)
        lame, shear = (values[part][:, None, None, None] for values in (solid.lame, solid.shear))
        volume = np.trace(slope, axis1=2, axis2=3)[..., None, None] * np.eye(3)
        stress = lame * volume + shear * (slope + slope.swapaxes(2, 3))
        pulled = (gradient @ stress) * weight[..., None, None]
        K = np.einsum("cqai,cqbi->cab", pulled, gradient, optimize=True)
        data += np.bincount(pairs[part].ravel(), K.ravel(), minlength=len(data))
    return symmetric_part(sp.csr_array((data, indices, indptr), shape=(n, n)))


def check_cells(element: str, nodes: np.ndarray, cells: np.ndarray, where: str) -> None:
    """Raise InputError when cells are inverted or flat at some quadrature point."""
    blank = np.zeros(len(cells))
    solid = Solid(element, nodes, cells, blank, blank, blank)
    for order in {ELEMENTS[element].stiffness_order, ELEMENTS[element].mass_order}:
        at = sample_element(element, order)
        low = np.concatenate([_jacobian(solid, part, at)[0].min(axis=1) for part in chunks(solid, at)])
        wrong = np.flatnonzero(~(low > 0.0))
        if wrong.size:
            shown = ", ".join(str(k) for k in wrong[:5]) + (" ..." if wrong.size > 5 else "")
            problem = f"{wrong.size} of {len(cells)} cells are inverted or flat (Jacobian not positive): {shown}"
            raise InputError(where, problem, "repair the mesh, or renumber the cells' nodes to a right-handed order")


def _jacobian(solid: Solid, part: slice, at: Sampled) -> tuple[np.ndarray, np.ndarray]:
    """Return determinant (c, q) and matrix dX/dxi (c, q, 3, 3) of the cells of a part."""
    X = solid.nodes[solid.cells[part]]
    J = np.einsum("cai,qaj->cqij", X, at.gradient, optimize=True)
    return np.linalg.det(J), J


def gradients(solid: Solid, part: slice, at: Sampled) -> tuple[np.ndarray, np.ndarray]:
    """Return weights times volume (c, q) and spatial gradients of the shape functions (c, q, nodes, 3)."""
    volume, J = _jacobian(solid, part, at)
    return volume * at.weight, at.gradient[None] @ np.linalg.inv(J)


def chunks(solid: Solid, at: Sampled, fields: int = 0) -> Iterator[slice]:
    """Yield ranges of cells whose matrices, or gradients of `fields` fields, stay within `AT_ONCE` numbers."""
    a = solid.cells.shape[1]
    step = max(1, AT_ONCE // (9 * a * a + 6 * a * len(at.weight) + 24 * fields * max(a, len(at.weight))))
    for start in range(0, len(solid.cells), step):
        yield slice(start, min(start + step, len(solid.cells)))


def _pattern(solid: Solid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return entries of each cell's node pairs in a sparse node matrix, (cells, pairs); columns and row pointers."""
    n, a = len(solid.nodes), solid.cells.shape[1]
    rows = np.repeat(solid.cells, a, axis=1).ravel().astype(np.int64)
    columns = np.tile(solid.cells, (1, a)).ravel().astype(np.int64)
    keys, index = np.unique(rows * n + columns, return_inverse=True)
    indptr = np.searchsorted(keys, np.arange(n + 1) * n)
    return index.reshape(-1, a * a), (keys % n).astype(np.int32), indptr.astype(np.int32)
