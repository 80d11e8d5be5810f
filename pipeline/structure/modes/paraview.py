"""Mode shapes as a file for ParaView."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

#: meshio's name of a drawn cell by its number of corners
CELLS = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}


def vtu(modes: xr.Dataset) -> bytes:
    """What is drawn of the body, with each shape as a vector at the nodes: ``mode_001_1563.71_Hz``, largest one 1."""
    import meshio  # slow to import and needed by this function alone

    points = {}
    for k, (hertz, shape) in enumerate(
        zip(modes["frequency"].values, modes["shape"].values.transpose(2, 0, 1), strict=True)
    ):
        name = f"mode_{k + 1:03d}_{hertz:.6g}_Hz"
        size = np.linalg.norm(shape[:, :3], axis=1).max()
        points[name] = shape[:, :3] / (size or 1.0)
        if shape[:, 3:].any():
            points[f"{name}_rotation"] = shape[:, 3:] / (size or np.linalg.norm(shape[:, 3:], axis=1).max())
    cells = [(CELLS[modes.sizes["corner"]], modes["cell_node"].values)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "modes.vtu"
        meshio.Mesh(modes["node_position"].values, cells, point_data=points).write(path, file_format="vtu")
        return path.read_bytes()
