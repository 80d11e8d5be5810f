"""Mode shapes of a body: a page to turn in the browser, and a file for ParaView."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Literal

import numpy as np
import pyvista as pv
import xarray as xr

from flexclear.pipeline.post.body_shape import box, faces, is_rod, scale_to, surface
from flexclear.pipeline.post.render import offline
from flexclear.pipeline.post.render.stage import plotter, shading, skin
from flexclear.pipeline.post.rod_shape import AROUND

#: drawn size of the largest displacement, as a share of the body's length
SHARE = 0.16
COLORS: Literal["viridis"] = "viridis"
#: cell of VTK by its number of corners
CELLS = {1: pv.CellType.VERTEX, 2: pv.CellType.LINE, 3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD}


def page(bundle: xr.Dataset, mode: int) -> bytes:
    """A self-contained HTML page with one mode shape that can be turned in the browser."""
    scene = plotter((900, 600))
    _draw(scene, bundle, mode)
    _look(scene, bundle)
    content = offline.page(scene)
    scene.close()
    return content


def vtu(bundle: xr.Dataset) -> bytes:
    """All mode shapes as node vectors ``mode_1``.. on the undeformed body, for ParaView."""
    cells = bundle.cell_node.values.astype(int)
    corners = cells.shape[1]
    connectivity = np.column_stack([np.full(len(cells), corners), cells]).ravel()
    kinds = np.full(len(cells), CELLS[corners])
    mesh = pv.UnstructuredGrid(connectivity, kinds, bundle.node_position.values)
    for k, frequency in enumerate(bundle.frequency.values):
        mesh.point_data[f"mode_{k + 1}_{frequency:.1f}Hz"] = bundle.shape_translation.values[:, :, k]
        mesh.point_data[f"mode_{k + 1}_rotation"] = bundle.shape_rotation.values[:, :, k]
    mesh.cell_data["radius"] = bundle.radius.values
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "modes.vtu"
        mesh.save(path)
        return path.read_bytes()


def _draw(scene: pv.Plotter, bundle: xr.Dataset, mode: int) -> None:
    q = np.zeros(bundle.sizes["mode"])
    ghost, _ = surface(bundle, q)
    q[mode] = 1.0
    points, size = surface(bundle, q, scale_to(bundle, q, SHARE))
    corners, look = faces(bundle), shading(bundle)
    body = skin(points, corners)
    # colour by displacement; for torsion, where the centre line rests, by the turn of the surface
    moved = np.linalg.norm(points - ghost, axis=-1) if size.max() < 1e-9 else size
    body["displacement"] = moved / moved.max()
    scene.add_mesh(skin(ghost, corners), color="#9aa5b1", opacity=0.22, **(look if corners.shape[1] == 1 else {}))
    scene.add_mesh(
        body, scalars="displacement", cmap=COLORS, clim=(0.0, 1.0), specular=0.25, show_scalar_bar=False, **look
    )
    if is_rod(bundle) and size.max() < 1e-9:
        # lines along the rod show its twist; where it bends they would be drawn in and out of its skin
        rings = points.reshape(-1, AROUND + 1, 3)
        for k in range(0, AROUND, 6):
            scene.add_mesh(pv.lines_from_points(rings[1:-1, k]), color="#ffffff", opacity=0.55, line_width=1.5)


def _look(scene: pv.Plotter, bundle: xr.Dataset) -> None:
    """From above and in front, the body's length across the picture, in perspective as the browser's view has it."""
    x = bundle.node_position.values
    (axis, *_), (length, *others) = box(bundle)
    axis = axis * (1.0 if axis @ (x[-1] - x[0]) >= 0.0 else -1.0)
    up = np.eye(3)[2] if abs(axis[2]) < 0.9 else np.eye(3)[0]
    across = np.cross(axis, up)
    direction = across / np.linalg.norm(across) + 0.9 * up - 0.35 * axis
    centre = 0.5 * (x.min(axis=0) + x.max(axis=0))
    # half the picture's height; the length of a slender body fills its width
    half = 0.30 * length + 0.5 * float(np.linalg.norm(others))
    scene.camera_position = [tuple(centre + 1.7 * half / 0.30 * direction), tuple(centre), tuple(up)]
