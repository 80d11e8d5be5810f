"""Solid elements: node numbering of VTK and meshio, shape functions and quadrature of scikit-fem."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from skfem import ElementHex1, ElementHex2, ElementHexS2, ElementTetP1, ElementTetP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefQuad, RefTri

HEX_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float
)
HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
#: corners of each face, anticlockwise seen from outside; faces at x = 0, 1, y = 0, 1, z = 0, 1
HEX_FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))
TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
TET_FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))


@dataclass(frozen=True)
class Element:
    """One type of cell.

    cell: meshio's name.  local: positions of its nodes in the reference cell, shape (nodes, 3).
    faces: corner nodes of each face.  between: for each node that is no corner, the corners with a mean close to it.
    stiffness_order, mass_order: degrees that the quadrature integrates; the mass of cells with curved sides is exact.
    stress_order: degree of the quadrature at whose points stress is taken, eight in a hexahedron, one or four in a
        tetrahedron.
    """

    cell: str
    basis: Any
    local: np.ndarray
    faces: tuple[tuple[int, ...], ...]
    between: dict[int, tuple[int, ...]]
    stiffness_order: int
    mass_order: int
    stress_order: int

    @property
    def face_nodes(self) -> np.ndarray:
        """All nodes of each face, shape (faces, nodes): corners, the nodes between neighbouring corners, the middle."""
        at = {frozenset(part): node for node, part in self.between.items()}
        faces = []
        for face in self.faces:
            sides = zip(face, (*face[1:], face[0]), strict=True)
            parts = [frozenset(side) for side in sides] + [frozenset(face)]
            faces.append([*face, *(at[part] for part in parts if part in at)])
        return np.array(faces)

    @property
    def corners(self) -> int:
        """Number of corner nodes, which come first."""
        return len(self.local) - len(self.between)


@dataclass(frozen=True)
class Sampled:
    """Shape functions at quadrature points: values (q, nodes), gradients (q, nodes, 3), weights (q,)."""

    value: np.ndarray
    gradient: np.ndarray
    weight: np.ndarray


def _element(
    cell: str,
    basis: Any,
    corners: np.ndarray,
    faces: tuple[tuple[int, ...], ...],
    inner: tuple[tuple[int, ...], ...],
    orders: tuple[int, int, int],
) -> Element:
    between = {len(corners) + k: part for k, part in enumerate(inner)}
    local = np.vstack([corners, *(corners[list(part)].mean(axis=0) for part in inner)])
    return Element(cell, basis, local, faces, between, *orders)


#: elements by the recipe's name
ELEMENTS = {
    "hex8": _element("hexahedron", ElementHex1(), HEX_CORNERS, HEX_FACES, (), (3, 5, 3)),
    "hex20": _element("hexahedron20", ElementHexS2(), HEX_CORNERS, HEX_FACES, HEX_EDGES, (5, 9, 3)),
    "hex27": _element(
        "hexahedron27", ElementHex2(), HEX_CORNERS, HEX_FACES, (*HEX_EDGES, *HEX_FACES, tuple(range(8))), (5, 9, 3)
    ),
    "tet4": _element("tetra", ElementTetP1(), TET_CORNERS, TET_FACES, (), (1, 2, 1)),
    "tet10": _element("tetra10", ElementTetP2(), TET_CORNERS, TET_FACES, TET_EDGES, (5, 7, 2)),
}


@cache
def sample_element(name: str, order: int) -> Sampled:
    """Return the shape functions of an element at the points of a quadrature of this order."""
    element = ELEMENTS[name]
    points, weight = get_quadrature(element.basis.refdom, order)
    return Sampled(*shape_functions(name, points), weight)


@cache
def from_stress_points(name: str) -> np.ndarray:
    """Return the matrix from values at the stress points to values at the nodes, shape (nodes, points).

    The polynomial through these points is trilinear in a hexahedron, linear or constant in a tetrahedron.
    """
    element = ELEMENTS[name]
    points, _ = get_quadrature(element.basis.refdom, element.stress_order)

    def powers(x: np.ndarray) -> np.ndarray:
        one, (a, b, c) = np.ones(len(x)), x.T
        return np.column_stack([one, a, b, c, a * b, b * c, c * a, a * b * c][: points.shape[1]])

    result: np.ndarray = powers(element.local) @ np.linalg.inv(powers(points.T))
    return result


@cache
def on_face(name: str, face: int) -> tuple[Sampled, np.ndarray]:
    """Return an element's shape functions at quadrature points of one face, and the face's two directions (2, 3)."""
    element = ELEMENTS[name]
    corners = element.local[list(element.faces[face])]
    directions = np.array([corners[1] - corners[0], corners[-1] - corners[0]])
    points, weight = get_quadrature(RefQuad if len(corners) == 4 else RefTri, element.mass_order)
    return Sampled(*shape_functions(name, (corners[0] + points.T @ directions).T), weight), directions


def shape_functions(name: str, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values (q, nodes) and gradients (q, nodes, 3) at points of the reference cell, shape (3, q)."""
    element = ELEMENTS[name]
    places = np.asarray(element.basis.doflocs)
    # from scikit-fem's node order to VTK's
    order = [int(np.argmin(np.abs(places - point).sum(axis=1))) for point in element.local]
    pairs = [element.basis.lbasis(points, i) for i in order]
    value = np.stack([np.broadcast_to(phi, points.shape[1:]) for phi, _ in pairs], axis=1)
    gradient = np.stack([np.broadcast_to(slope, points.shape).T for _, slope in pairs], axis=1)
    return value, gradient
