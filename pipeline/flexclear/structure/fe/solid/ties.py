r"""Frames tied to nodes: selection of the nodes, and rigid or mean ties.

Rigid (RBE2): the nodes follow the frame, :math:`u_n = u_p + \theta\times(x_n - p)`. Mean (RBE3): the frame follows the
nodes, with weights w (the area that a node represents) and :math:`c = \sum w x / \sum w`,

.. math:: \theta = J^{-1}\sum w\,(x_n-c)\times u_n, \quad J = \sum w\,(|r|^2 1 - r r^T), \quad
          u_p = \sum w\,u_n/\sum w + \theta\times(p - c) .

A force on such a frame acts as tractions of the same resultant, and nothing is stiffened.
Source: the MSC Nastran elements of these names; Heirman & Desmet (2010), Multibody Syst. Dyn. 23, 219-243.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexclear.numerics.rotations import skew
from flexclear.scene.registry import suggestion
from flexclear.structure.fe.solid.elements import on_face
from flexclear.structure.fe.solid.geometry import Geometry, boundary, boundary_nodes, face_nodes
from flexclear.structure.fe.solid.recipe import On
from flexclear.system.errors import InputError

#: default distance from a surface within which a node lies on it, as a fraction of the body's size
TOLERANCE = 1e-6


def selected_nodes(geometry: Geometry, on: On, where: str) -> np.ndarray:
    """Return the nodes that a rule selects, ascending; raise InputError for no node or an unknown region."""
    if on.region is not None:
        named = regions(geometry)
        if on.region not in named:
            hint = suggestion(on.region, named) if named else "the mesh has none; select by plane or cylinder"
            raise InputError(f"{where[:-1]}.region]", f"no region is called '{on.region}'", hint)
        nodes = named[on.region]
    else:
        nodes = _nodes_on_surface(geometry, on)
    if nodes.size == 0:
        x = geometry.nodes
        box = " to ".join(str([float(f"{v:.6g}") for v in end]) for end in (x.min(axis=0), x.max(axis=0)))
        raise InputError(where, f"selects no node; the body lies within {box} m", "check position and units")
    return nodes


def regions(geometry: Geometry) -> dict[str, np.ndarray]:
    """Return the nodes of each named region; of a region with faces and cells, those of the faces."""
    of_cells = {name: np.unique(geometry.cells[cells]) for name, cells in geometry.cell_regions.items()}
    return of_cells | geometry.node_regions


def _nodes_on_surface(geometry: Geometry, on: On) -> np.ndarray:
    outside = boundary_nodes(geometry)
    x = geometry.nodes[outside]
    if on.plane is not None:
        normal = np.array(on.plane.normal) / np.linalg.norm(on.plane.normal)
        distance = (x - np.array(on.plane.point)) @ normal
    elif on.cylinder is not None:
        axis = np.array(on.cylinder.axis) / np.linalg.norm(on.cylinder.axis)
        r = x - np.array(on.cylinder.point)
        distance = np.linalg.norm(r - np.outer(r @ axis, axis), axis=1) - on.cylinder.radius
    else:
        assert on.sphere is not None
        distance = np.linalg.norm(x - np.array(on.sphere.centre), axis=1) - on.sphere.radius
    limit = on.tolerance if on.tolerance is not None else TOLERANCE * float(np.ptp(geometry.nodes, axis=0).max())
    return outside[np.abs(distance) <= limit]


def areas(geometry: Geometry, nodes: np.ndarray) -> np.ndarray:
    """Return integrals of the nodes' shape functions over the selected faces [m^2]; ones without a selected face."""
    weight = np.zeros(len(geometry.nodes))
    cells, faces = boundary(geometry)
    whole = np.isin(face_nodes(geometry, cells, faces), nodes).all(axis=1)
    for face in np.unique(faces[whole]):
        at, directions = on_face(geometry.element, int(face))
        part = geometry.cells[cells[whole & (faces == face)]]
        J = np.einsum("cai,qaj->cqij", geometry.nodes[part], at.gradient, optimize=True)
        along, across = (np.einsum("cqij,j->cqi", J, d) for d in directions)
        area = np.linalg.norm(np.cross(along, across), axis=2) * at.weight
        np.add.at(weight, part, area @ at.value)
    return weight[nodes] if weight[nodes].any() else np.ones(len(nodes))


def centre(x: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the weighted centre of points (n, 3)."""
    return weight @ x / weight.sum()


def check_rank(x: np.ndarray, where: str) -> None:
    """Raise InputError when the nodes lie on a line, about which a rotation is not determined."""
    spread = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
    if len(x) < 3 or spread[1] < 1e-9 * spread[0]:
        problem = f"{len(x)} nodes on a line cannot carry a frame's rotation"
        raise InputError(where, problem, "select a face, or more nodes of it")


def mean(x: np.ndarray, weight: np.ndarray, nodes: np.ndarray, position: np.ndarray, size: int) -> sp.csr_array:
    """Return the motion of a frame that follows nodes, as functionals of all displacements, shape (6, 3 size)."""
    w = weight / weight.sum()
    c = centre(x, w)
    r = x - c
    J = np.einsum("n,nk->", w, r**2) * np.eye(3) - np.einsum("n,nk,nl->kl", w, r, r)
    turn = np.linalg.solve(J, (w[:, None, None] * skew(r)).transpose(1, 0, 2).reshape(3, -1))
    shift = (w[:, None, None] * np.eye(3)).transpose(1, 0, 2).reshape(3, -1) - skew(position - c) @ turn
    values = np.vstack([shift, turn])
    columns = (3 * nodes[:, None] + np.arange(3)).ravel()
    rows = np.repeat(np.arange(6), columns.size)
    return sp.csr_array((values.ravel(), (rows, np.tile(columns, 6))), shape=(6, 3 * size))
