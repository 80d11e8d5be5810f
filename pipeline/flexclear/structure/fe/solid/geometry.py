"""Meshes of one element type with named regions, from any source: their boundary and their checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph

from flexclear.structure.fe.solid import lattice
from flexclear.structure.fe.solid.elasticity import check_cells
from flexclear.structure.fe.solid.elements import ELEMENTS
from flexclear.structure.fe.solid.recipe import Block, Cylinder
from flexclear.system.errors import InputError

#: largest distance of a mid-side, face or cell node from the mean of its corners, as a fraction of the cell's size
ASTRAY = 0.3


@dataclass(frozen=True)
class Geometry:
    """Nodes [m] (n, 3), cells (c, nodes per cell), and named regions of nodes and of cells."""

    element: str
    nodes: np.ndarray
    cells: np.ndarray
    node_regions: dict[str, np.ndarray]
    cell_regions: dict[str, np.ndarray]


def generate_mesh(shape: Cylinder | Block) -> Geometry:
    """Generate the mesh of a cylinder or block."""
    if isinstance(shape, Cylinder):
        n = shape.cells
        nodes, cells = lattice.cylinder(shape.radius, shape.length, n.along, n.across, n.rings)
        length = shape.length
    else:
        nodes, cells = lattice.box_cells(shape.size, shape.cells)
        length = shape.size[0]
    nodes, cells = lattice.cut_cells(nodes, cells, shape.element)
    x = nodes[:, 0]
    bare = Geometry(shape.element, nodes, cells, {}, {"body": np.arange(len(cells))})
    start, end = (np.flatnonzero(np.abs(x - end_at) < 1e-9 * length) for end_at in (0.0, length))
    faces = face_nodes(bare, *boundary(bare))
    # the nodes of mantle faces have different x
    mantle = np.unique(faces[np.ptp(x[faces], axis=1) > 1e-9 * length])
    regions = {"start": start, "end": end, "side": mantle}
    return Geometry(shape.element, nodes, cells, regions, bare.cell_regions)


def boundary(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Return cell and face number of each face that belongs to one cell only."""
    first, count = _faces(geometry)
    return np.divmod(np.sort(first[count == 1]), len(ELEMENTS[geometry.element].faces))


def _faces(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Return each face once: its first index among the faces of all cells in turn, and its number of cells."""
    faces = np.array(ELEMENTS[geometry.element].faces)
    corners = np.sort(geometry.cells[:, faces], axis=2).reshape(-1, faces.shape[1])
    _, first, count = np.unique(corners, axis=0, return_index=True, return_counts=True)
    return first, count


def face_nodes(geometry: Geometry, cells: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return all nodes of the faces, corners first, shape (faces, nodes)."""
    return np.take_along_axis(geometry.cells[cells], ELEMENTS[geometry.element].face_nodes[faces], axis=1)


def boundary_nodes(geometry: Geometry) -> np.ndarray:
    """Return all nodes on the boundary, ascending."""
    return np.unique(face_nodes(geometry, *boundary(geometry)))


def check(geometry: Geometry, where: str) -> None:
    """Raise InputError for inverted, wrongly numbered or overlapping cells, and for a body in several pieces."""
    _check_numbering(geometry, where)
    check_cells(geometry.element, geometry.nodes, geometry.cells, where)
    _check_overlap(geometry, where)
    _check_pieces(geometry, where)


def _check_overlap(geometry: Geometry, where: str) -> None:
    corners = np.sort(geometry.cells[:, : ELEMENTS[geometry.element].corners], axis=1)
    twice = len(corners) - len(np.unique(corners, axis=0))
    crowded = int(np.count_nonzero(_faces(geometry)[1] > 2))
    if twice or crowded:
        problem = f"{twice} duplicate cells" if twice else f"{crowded} faces belong to more than two cells"
        raise InputError(where, f"cells overlap: {problem}", "write each cell once; merge meshes only where they touch")


def _check_pieces(geometry: Geometry, where: str) -> None:
    n, a = len(geometry.nodes), geometry.cells.shape[1]
    rows = np.repeat(geometry.cells[:, 0], a)
    graph = sp.csr_array((np.ones(rows.size, dtype=np.int8), (rows, geometry.cells.ravel())), shape=(n, n))
    count, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    if count > 1:
        sizes = np.sort(np.bincount(label[geometry.cells[:, 0]]))[::-1]
        shown = ", ".join(str(k) for k in sizes[:5])
        problem = f"the mesh is in {count} pieces without common nodes (of {shown} cells)"
        raise InputError(where, problem, "merge the nodes where the pieces touch, or define each as a separate body")


def _check_numbering(geometry: Geometry, where: str) -> None:
    element = ELEMENTS[geometry.element]
    X = geometry.nodes[geometry.cells]
    size = np.linalg.norm(np.ptp(X, axis=1), axis=1)
    for node, part in element.between.items():
        away = np.linalg.norm(X[:, node] - X[:, list(part)].mean(axis=1), axis=1)
        wrong = np.flatnonzero(away > ASTRAY * size)
        if wrong.size:
            raise InputError(
                where,
                f"node {node + 1} of cell {wrong[0]} is far from the middle of its corners: "
                f"the nodes of a {element.cell} are not in the order of VTK",
                "write the mesh with meshio's or VTK's node order",
            )
