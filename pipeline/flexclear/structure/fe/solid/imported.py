"""Meshes from files that meshio reads: one type of solid cells, units as declared, named regions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexclear.scene.units import UNITS
from flexclear.structure.fe.solid.elements import ELEMENTS
from flexclear.structure.fe.solid.geometry import Geometry
from flexclear.structure.fe.solid.recipe import MeshFile
from flexclear.system.errors import InputError
from flexclear.system.external_files import read_mesh

if TYPE_CHECKING:
    from meshio import Mesh

#: names of elements by meshio's names
NAMES = {element.cell: name for name, element in ELEMENTS.items()}
#: other cells that a file may hold; those of faces name surfaces
FACES = ("triangle", "triangle6", "triangle7", "quad", "quad8", "quad9")
OTHER_CELLS = ("vertex", "line", "line3", *FACES)
REWRITE = "export only its solid cells and named sets, or write VTU or Gmsh"


def read_geometry(shape: MeshFile, folder: Path, where: str) -> Geometry:
    """Read the mesh in a file; raise InputError for an unreadable one, or unless it has one type of solid cells."""
    path = folder / shape.file
    mesh = read_mesh(path, where, f"meshio cannot read '{path.name}'", REWRITE)
    name = _cell_type(mesh, where)
    scale = UNITS[shape.length_unit][0]
    solid = [k for k, block in enumerate(mesh.cells) if block.type == name]
    cells = _cells([mesh.cells[k].data for k in solid], len(ELEMENTS[NAMES[name]].local), len(mesh.points), where)
    used, inverse = np.unique(cells, return_inverse=True)
    renumber = np.full(len(mesh.points), -1, dtype=np.int64)
    renumber[used] = np.arange(len(used))
    cell_regions, node_regions = _regions(mesh, solid, renumber)
    nodes = scale * _points(mesh, where)[used]
    return Geometry(NAMES[name], nodes, inverse.reshape(cells.shape), node_regions, cell_regions)


def _cell_type(mesh: Mesh, where: str) -> str:
    counts = {block.type: sum(len(b.data) for b in mesh.cells if b.type == block.type) for block in mesh.cells}
    solid = {name: count for name, count in counts.items() if name not in OTHER_CELLS}
    listed = ", ".join(f"{count} {name}" for name, count in (solid or counts).items()) or "no cells at all"
    known = ", ".join(NAMES)
    if not solid:
        raise InputError(where, f"the mesh has no solid cells but {listed}", f"known: {known}")
    if len(solid) > 1:
        raise InputError(where, f"the mesh mixes solid cells: {listed}", f"mesh the body with one of {known}")
    (name,) = solid
    if name not in NAMES:
        raise InputError(where, f"cells of type {name} are not supported", f"mesh the body with one of {known}")
    return name


def _cells(blocks: list[np.ndarray], nodes: int, points: int, where: str) -> np.ndarray:
    """Return the nodes of all solid cells, shape (cells, nodes); raise InputError where a reader lost some."""
    wrong = [np.shape(block)[1:] for block in blocks if np.shape(block)[1:] != (nodes,)]
    if wrong:
        problem = (
            f"cells that need {nodes} nodes were read with {wrong[0][0] if wrong[0] else 'different numbers of them'}"
        )
        raise InputError(where, problem, REWRITE)
    cells = np.vstack(blocks).astype(np.int64)
    if cells.min() < 0 or cells.max() >= points:
        raise InputError(where, f"cells refer to nodes beyond the {points} of the file", REWRITE)
    return cells


def _points(mesh: Mesh, where: str) -> np.ndarray:
    points = np.asarray(mesh.points, dtype=float)
    if points.shape[1] != 3 or not np.isfinite(points).all():
        raise InputError(where, "the nodes' coordinates are not three finite numbers each", REWRITE)
    return points


def _regions(mesh: Mesh, solid: list[int], renumber: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return named regions of solid cells (indices into all of them) and of nodes (renumbered).

    Faces and solid cells may be numbered separately: where a group has both, its nodes are those of the faces.
    """
    first = np.cumsum([0, *(len(mesh.cells[k].data) for k in solid)])
    of_cells: dict[str, list[np.ndarray]] = {}
    of_nodes: dict[str, list[np.ndarray]] = {}
    for name, chosen in _cell_groups(mesh):
        faces = [k for k, block in enumerate(mesh.cells) if block.type in FACES and len(chosen[k])]
        for k, block in enumerate(mesh.cells):
            if k in solid and len(chosen[k]):
                of_cells.setdefault(name, []).append(first[solid.index(k)] + chosen[k])
            if len(chosen[k]) and (not faces or k in faces):
                of_nodes.setdefault(name, []).append(block.data[chosen[k]].ravel())
    for name, nodes in mesh.point_sets.items():
        of_nodes.setdefault(name, []).append(nodes)
    cells = {name: np.unique(np.concatenate(parts)) for name, parts in of_cells.items()}
    numbers = {name: np.unique(renumber[np.concatenate(parts)]) for name, parts in of_nodes.items()}
    return cells, {name: members[members >= 0] for name, members in numbers.items()}


def _cell_groups(mesh: Mesh) -> list[tuple[str, list[np.ndarray]]]:
    """Return named groups of cells: for each block, the indices that belong to the group."""
    groups = list(mesh.cell_sets.items())
    for key, values in mesh.cell_data.items():
        different = np.unique(np.concatenate(values))
        # 1000: an integer array of cell data with more distinct values numbers the cells and names no regions
        for value in different if len(different) <= 1000 else ():
            chosen = [np.flatnonzero(part == value) for part in values]
            groups.append((f"{key}={value}", chosen))
            if key == "gmsh:physical":
                groups += [
                    (n, _cells_of_dimension(mesh, chosen, dim))
                    for n, (tag, dim) in mesh.field_data.items()
                    if tag == value
                ]
    return groups


def _cells_of_dimension(mesh: Mesh, chosen: list[np.ndarray], dimension: int) -> list[np.ndarray]:
    """Return the chosen cells of one dimension: Gmsh numbers the tags of surfaces and of volumes separately."""
    return [part if block.dim == dimension else part[:0] for part, block in zip(chosen, mesh.cells, strict=True)]
