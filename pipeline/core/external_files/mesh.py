"""Meshes and surfaces in files, as meshio reads them in the child process: arrays and names alone."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexclear.pipeline.core.external_files import isolated
from flexclear.pipeline.core.workflow import file_dependencies

#: what meshio keeps among the sets of cells of a Gmsh 4 file, but numbers of curves and points
NO_CELLS = "gmsh:bounding_entities"


@dataclass(frozen=True)
class Block:
    """Cells of one type, by meshio's name.

    data: nodes, shape (cells, nodes); (cells,) where they have different numbers of them.  dim: of the cells.
    """

    type: str
    dim: int
    data: np.ndarray


@dataclass(frozen=True)
class Mesh:
    """What of a mesh is used here.

    points: shape (points, 1 to 3).  point_sets: nodes by name.  cell_sets: for each block its cells of that name.
    cell_data: for each block one integer per cell, by name.  field_data: number and dimension of a name of Gmsh.
    """

    points: np.ndarray
    cells: tuple[Block, ...]
    point_sets: Mapping[str, np.ndarray]
    cell_sets: Mapping[str, list[np.ndarray]]
    cell_data: Mapping[str, list[np.ndarray]]
    field_data: Mapping[str, list[int]]


def read(path: Path) -> Mesh:
    """The mesh in a file.  Raises `isolated.UnreadableError`, and as `isolated.read` does."""
    mesh = isolated.read(parse, path)
    cells = tuple(Block(**block) for block in mesh.pop("cells"))
    return Mesh(cells=cells, **mesh)


def parse(path: Path) -> dict[str, Any]:
    """Fields of `Mesh` as a table; ValueError in words for what cannot be read."""
    import meshio  # slow to import, and only meshes from files need it

    _note_companions(path)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), np.errstate(over="ignore"):
            # meshio takes text for the length of a binary file, to see that it is none
            mesh = meshio.read(path)
    except SystemExit:
        # meshio prints its reason and ends the process where the content is not what it knows of that suffix
        raise ValueError(" ".join(said.getvalue().split()) or "meshio does not know its format") from None
    points = np.asarray(mesh.points)
    points = points if points.size else np.empty((0, 3))
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3 or points.dtype.kind not in "iuf":
        raise ValueError(f"its points are an array of {points.dtype}, {points.shape}")
    return {
        "points": points,
        "cells": [{"type": block.type, "dim": int(block.dim), "data": _nodes(block.data)} for block in mesh.cells],
        "point_sets": {name: _numbers(nodes) for name, nodes in (mesh.point_sets or {}).items()},
        "cell_sets": {
            name: [_numbers(c) for c in chosen] for name, chosen in (mesh.cell_sets or {}).items() if name != NO_CELLS
        },
        "cell_data": _integers(mesh.cell_data or {}),
        "field_data": {name: [int(n) for n in pair] for name, pair in (mesh.field_data or {}).items()},
    }


def _nodes(data: Any) -> np.ndarray:
    array = np.asarray(data)
    return array if array.dtype.kind in "iuf" else np.zeros(len(array), dtype=np.int64)


def _numbers(data: Any) -> np.ndarray:
    return np.empty(0, dtype=np.int64) if data is None else np.asarray(data, dtype=np.int64).ravel()


def _integers(data: Mapping[str, Any]) -> dict[str, list[np.ndarray]]:
    arrays = {name: [np.asarray(part) for part in parts] for name, parts in data.items()}
    return {
        name: parts
        for name, parts in arrays.items()
        if all(part.dtype.kind in "iu" and part.ndim == 1 for part in parts)
    }


def _note_companions(path: Path) -> None:
    """XDMF keeps its numbers in HDF5 files, which a library in C opens."""
    if path.suffix in (".xdmf", ".xmf"):
        words = re.split(r"[\s<>]+", path.read_text(encoding="utf-8", errors="replace"))
        for name in {word.partition(".h5:")[0] for word in words if ".h5:" in word}:
            file_dependencies.note(path.parent / f"{name}.h5")
