"""Surfaces from files, to be drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.external_files import read_mesh
from flexclear.pipeline.post.render import surfaces
from flexclear.pipeline.post.render.surfaces import Surface

#: bytes of a surface: more is no picture that anybody waits for; and how far its points may be [m]
LARGEST, FARTHEST = 200_000_000, 1e15
#: faces of cells, by their corners, seen from outside
_SIDES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}


def read(path: Path, unit: float) -> Surface:
    """A surface from a file that meshio reads; tetrahedra and hexahedra give their boundary."""
    remedy = "give an STL, VTK, PLY or OBJ file"
    mesh = read_mesh(path, f"{path}", "is no surface that can be drawn", remedy, LARGEST)
    faces = []
    for block in mesh.cells:
        if block.type in ("triangle", "quad"):
            faces.append(surfaces.triangulated(block.data.astype(int)))
        elif block.type in _SIDES:
            faces.append(_boundary(block.data.astype(int), _SIDES[block.type]))
    if not faces:
        raise InputError(f"{path}", "has no triangles, quadrangles, tetrahedra or hexahedra", "export a surface")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = unit * mesh.points
    triangles = np.concatenate(faces)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(points)):
        raise InputError(f"{path}", f"its faces name points beyond the {len(points)} that it has", "export it again")
    if not np.abs(points).max(initial=0.0) < FARTHEST:
        raise InputError(f"{path}", "its points are no finite numbers, or too large to be drawn", "export it again")
    return surfaces.shaded(points, triangles, sharp=True)


def _boundary(cells: np.ndarray, sides: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Triangles of the faces that belong to one cell only."""
    faces = cells[:, list(sides)].reshape(-1, len(sides[0]))
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return surfaces.triangulated(faces[first[count == 1]])
