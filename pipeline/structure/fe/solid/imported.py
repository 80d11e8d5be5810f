"""Meshes from files, as far as meshio reads them: one type of solid cells, units as declared, regions by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.errors import InputError
from pipeline.core.units import UNITS
from pipeline.structure.fe.solid.elements import ELEMENTS
from pipeline.structure.fe.solid.geometry import Geometry
from pipeline.structure.fe.solid.recipe import MeshFile

#: names of types by meshio's
NAMES = {element.cell: name for name, element in ELEMENTS.items()}
#: cells that may come along; those of faces name surfaces
FACES = ("triangle", "triangle6", "triangle7", "quad", "quad8", "quad9")
BESIDES = ("vertex", "line", "line3", *FACES)


def read(shape: MeshFile, folder: Path, where: str) -> Geometry:
    """The mesh in a file; InputError when it cannot be read, has no solid cells or several types of them."""
    mesh = _read(folder / shape.file, where)
    name = _cell_type(mesh, where)
    scale = UNITS[shape.length_unit][0]
    solid = [k for k, block in enumerate(mesh.cells) if block.type == name]
    cells = np.vstack([mesh.cells[k].data for k in solid]).astype(np.int64)
    used, inverse = np.unique(cells, return_inverse=True)
    renumber = np.full(len(mesh.points), -1, dtype=np.int64)
    renumber[used] = np.arange(len(used))
    cell_regions, node_regions = _regions(mesh, solid, renumber)
    nodes = scale * np.asarray(mesh.points, dtype=float)[used]
    return Geometry(NAMES[name], nodes, inverse.reshape(cells.shape), node_regions, cell_regions)


def _read(path: Path, where: str) -> Any:
    import meshio  # slow to import, and only meshes from files need it

    if not path.is_file():
        raise InputError(where, f"there is no file {path}", "paths are relative to the recipe")
    try:
        return meshio.read(path)
    except SystemExit:
        # meshio ends the process on a suffix that it does not know, or content that is not what the suffix says
        problem = f"meshio cannot read '{path.name}': its format is unknown or its content is something else"
        raise InputError(where, problem, "write it again, or as VTU") from None
    except Exception as error:
        raise InputError(where, f"meshio cannot read '{path.name}': {error}", "write it again, or as VTU") from None


def _cell_type(mesh: Any, where: str) -> str:
    found = {block.type: sum(len(b.data) for b in mesh.cells if b.type == block.type) for block in mesh.cells}
    solid = {name: count for name, count in found.items() if name not in BESIDES}
    listed = ", ".join(f"{count} {name}" for name, count in (solid or found).items()) or "no cells at all"
    known = ", ".join(NAMES)
    if not solid:
        raise InputError(where, f"the mesh has no solid cells but {listed}", f"known: {known}")
    if len(solid) > 1:
        raise InputError(where, f"the mesh mixes solid cells: {listed}", f"mesh the body with one of {known}")
    (name,) = solid
    if name not in NAMES:
        raise InputError(where, f"cells of type {name} are not supported", f"mesh the body with one of {known}")
    return name


def _regions(mesh: Any, solid: list[int], renumber: np.ndarray) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Regions of solid cells (indices into all of them) and of nodes (renumbered), by name."""
    first = np.cumsum([0, *(len(mesh.cells[k].data) for k in solid)])
    of_cells: dict[str, list[np.ndarray]] = {}
    of_nodes: dict[str, list[np.ndarray]] = {}
    for name, chosen in _cell_groups(mesh):
        for k, block in enumerate(mesh.cells):
            if len(chosen[k]) == 0:
                continue
            if k in solid:
                of_cells.setdefault(name, []).append(first[solid.index(k)] + chosen[k])
            of_nodes.setdefault(name, []).append(block.data[chosen[k]].ravel())
    for name, nodes in (mesh.point_sets or {}).items():
        of_nodes.setdefault(str(name), []).append(np.asarray(nodes, dtype=np.int64).ravel())
    cells = {name: np.unique(np.concatenate(parts)) for name, parts in of_cells.items()}
    numbers = {name: np.unique(renumber[np.concatenate(parts)]) for name, parts in of_nodes.items()}
    return cells, {name: found[found >= 0] for name, found in numbers.items()}


def _cell_groups(mesh: Any) -> list[tuple[str, list[np.ndarray]]]:
    """Named groups of cells: for each block, the indices that belong to it."""
    groups: list[tuple[str, list[np.ndarray]]] = []
    for name, chosen in (mesh.cell_sets or {}).items():
        parts = [np.empty(0, dtype=np.int64) if c is None else np.asarray(c, dtype=np.int64).ravel() for c in chosen]
        groups.append((str(name), parts))
    named = {(int(tag), int(dim)): str(name) for name, (tag, dim) in (mesh.field_data or {}).items()}
    for key, data in (mesh.cell_data or {}).items():
        values = [np.asarray(part) for part in data]
        if any(part.dtype.kind not in "iu" or part.ndim != 1 for part in values):
            continue
        for value in np.unique(np.concatenate(values)):
            chosen = [np.flatnonzero(part == value) for part in values]
            groups.append((f"{key}={value}", chosen))
            if key == "gmsh:physical":
                groups += _physical(mesh, int(value), chosen, named)
    return groups


def _physical(
    mesh: Any, tag: int, chosen: list[np.ndarray], named: dict[tuple[int, int], str]
) -> list[tuple[str, list[np.ndarray]]]:
    """A Gmsh tag's groups by their names; tags of surfaces and volumes are counted apart."""
    found = []
    for (known, dimension), name in named.items():
        if known == tag:
            of_dimension = [
                part if block.dim == dimension else part[:0] for part, block in zip(chosen, mesh.cells, strict=True)
            ]
            found.append((name, of_dimension))
    return found
