"""Meshes of one element type with named regions: boundary and checks; generated blocks and cylinders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph

from flexclear.structure.fe.solid.elasticity import check_cells
from flexclear.structure.fe.solid.elements import ELEMENTS, HEX_FACES, TET_EDGES, shape_functions
from flexclear.structure.fe.solid.recipe import Block, Cylinder
from flexclear.system.errors import InputError


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
        nodes, cells = cylinder(shape.radius, shape.length, n.along, n.across, n.rings)
        length = shape.length
    else:
        nodes, cells = box_cells(shape.size, shape.cells)
        length = shape.size[0]
    nodes, cells = cut_cells(nodes, cells, shape.element)
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
        # 0.3: largest distance of a mid-side, face or cell node from the mean of its corners, as a fraction of the
        # cell's size
        wrong = np.flatnonzero(away > 0.3 * size)
        if wrong.size:
            raise InputError(
                where,
                f"node {node + 1} of cell {wrong[0]} is far from the middle of its corners: "
                f"the nodes of a {element.cell} are not in the order of VTK",
                "write the mesh with meshio's or VTK's node order",
            )


#: outward bulge of the core's sides, as a fraction of its half side; evens out the angles at its corners
BULGE = 0.12


def box_cells(size: tuple[float, float, float], cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and 27-node cells (c, 27) of a box from x = 0, centred in y and z; size [m]."""
    section, quads = _patch(lambda s, t: np.stack([size[1] * (s - 0.5), size[2] * (t - 0.5)], axis=-1), *cells[1:])
    return _extrude(section, quads, size[0], cells[0])


def cylinder(radius: float, length: float, along: int, across: int, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 3) and 27-node cells (c, 27) of a round rod along x from x = 0; lengths [m].

    across: cells along each side of the core.  rings: of cells around the core; the outermost nodes lie on the circle.
    """
    # 0.55: half side of the square core of a cylinder's section, as a fraction of the radius
    half = 0.55 * radius
    patches = [_patch(lambda s, t: _core(2.0 * s - 1.0, 2.0 * t - 1.0) * half, across, across)]
    for quarter in range(4):
        turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), quarter)
        patches.append(_patch(lambda s, t, R=turn: _shell(s, t, half, radius) @ R.T, rings, across))
    offsets = np.cumsum([0, *(len(points) for points, _ in patches)])
    points = np.vstack([points for points, _ in patches])
    quads = np.vstack([quads + offset for (_, quads), offset in zip(patches, offsets, strict=False)])
    points, mask = _merge_points(points, radius)
    return _extrude(points, mask[quads], length, along)


def cut_cells(nodes: np.ndarray, cells: np.ndarray, element: str) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and cells of another element type; each 27-node cell becomes one hexahedron or 24 tetrahedra."""
    if element.startswith("hex"):
        part = cells[:, : len(ELEMENTS[element].local)]
        used, inverse = np.unique(part, return_inverse=True)
        return nodes[used], inverse.reshape(part.shape)
    local = _tetrahedra(element)
    value, _ = shape_functions("hex27", local.reshape(-1, 3).T)
    points = np.einsum("pa,cai->cpi", value, nodes[cells], optimize=True).reshape(-1, 3)
    points, mask = _merge_points(points, float(np.ptp(nodes, axis=0).max()))
    return points, mask.reshape(-1, local.shape[1])


def _tetrahedra(element: str) -> np.ndarray:
    """Return the nodes of 24 tetrahedra in the unit cube, each on centre, face centre and an edge, (24, nodes, 3)."""
    corners = ELEMENTS["hex8"].local
    cells = []
    for face in HEX_FACES:
        middle = corners[list(face)].mean(axis=0)
        for a, b in zip(face, (*face[1:], face[0]), strict=True):
            # corners of a face are anticlockwise from outside, so this order is right-handed
            four = np.array([corners[a], corners[b], middle, np.full(3, 0.5)])
            four = four if np.linalg.det(four[1:] - four[0]) > 0.0 else four[[1, 0, 2, 3]]
            middles = [0.5 * (four[i] + four[j]) for i, j in TET_EDGES] if element == "tet10" else []
            cells.append(np.vstack([four, *middles]))
    return np.array(cells)


def _patch(position: object, cells_s: int, cells_t: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 2) and 3 by 3 node quads (c, 3, 3) of a mapped unit square, node [i, j] at s_i, t_j."""
    s, t = np.meshgrid(np.linspace(0.0, 1.0, 2 * cells_s + 1), np.linspace(0.0, 1.0, 2 * cells_t + 1), indexing="ij")
    points = position(s, t).reshape(-1, 2)  # type: ignore[operator]
    number = np.arange(points.shape[0]).reshape(s.shape)
    quads = [number[2 * i : 2 * i + 3, 2 * j : 2 * j + 3] for i in range(cells_s) for j in range(cells_t)]
    return points, np.array(quads)


def _core(s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return points of the square [-1, 1]^2 with sides that bulge outwards."""
    return np.stack([s * (1.0 + BULGE * (1.0 - t**2)), t * (1.0 + BULGE * (1.0 - s**2))], axis=-1)


def _shell(s: np.ndarray, t: np.ndarray, half: float, radius: float) -> np.ndarray:
    """Return points between the core's side at +y (s = 0) and the quarter circle next to that side (s = 1)."""
    side = 2.0 * t - 1.0
    inner = half * _core(np.ones_like(side), side)
    angle = 0.25 * np.pi * side
    outer = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return inner + s[..., None] * (outer - inner)


def _merge_points(points: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points without repetitions, and the new number of each."""
    # neighbours are at least 1e-4 of the size away, equal nodes 1e-15; the offset keeps zero off a grid edge
    grid = np.floor(points / (1e-7 * size) + 0.4142).astype(np.int64)
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.ravel()


def _extrude(section: np.ndarray, quads: np.ndarray, length: float, layers: int) -> tuple[np.ndarray, np.ndarray]:
    """Extrude section points (n, 2) in y and z along x into layers of 27-node cells."""
    x = np.linspace(0.0, length, 2 * layers + 1)
    n = len(section)
    nodes = np.column_stack([np.repeat(x, n), np.tile(section, (len(x), 1))])
    # VTK's node order on the 3 by 3 by 3 lattice: first axis x, then the two of the quad
    lattice = (2.0 * ELEMENTS["hex27"].local).astype(int)
    i, j, k = lattice.T
    cells = [n * (2 * layer + i) + quads[:, j, k] for layer in range(layers)]
    return nodes, np.vstack(cells)
