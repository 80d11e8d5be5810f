"""VTU files of meshes and mode shapes, for ParaView and meshio."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

#: meshio's name of a drawn cell, by its number of corners
CELLS = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}


def vtu(
    points: np.ndarray,
    cell: str,
    corners: np.ndarray,
    of_points: Mapping[str, np.ndarray] | None = None,
    of_cells: Mapping[str, np.ndarray] | None = None,
) -> bytes:
    """Return a VTU file of cells of one kind, by meshio's name, with values at the points [m] and in the cells."""
    import meshio  # slow to import, and only this function needs it

    cell_data = {name: [values] for name, values in (of_cells or {}).items()}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "grid.vtu"
        grid = meshio.Mesh(points, [(cell, corners)], point_data=dict(of_points or {}), cell_data=cell_data)
        grid.write(path, file_format="vtu")
        return path.read_bytes()


def of_modes(modes: xr.Dataset) -> bytes:
    """Return a VTU file of mode shapes, nodal vectors of largest length 1, named like ``mode_001_1563.71_Hz``."""
    points = {}
    shapes = modes["shape"].values.transpose(2, 0, 1)
    for k, (hertz, shape) in enumerate(zip(modes["frequency"].values, shapes, strict=True)):
        name = f"mode_{k + 1:03d}_{hertz:.6g}_Hz"
        size = np.linalg.norm(shape[:, :3], axis=1).max()
        points[name] = shape[:, :3] / (size or 1.0)
        if shape[:, 3:].any():
            points[f"{name}_rotation"] = shape[:, 3:] / (size or np.linalg.norm(shape[:, 3:], axis=1).max())
    return vtu(modes["node_position"].values, CELLS[modes.sizes["corner"]], modes["cell_node"].values, points)
