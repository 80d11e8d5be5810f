"""A pyvista plotter with this project's light and background, and quiet about missing displays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr
from vtkmodules.vtkCommonCore import vtkLogger

from flexclear.pipeline.post.render.surfaces import Surface
from flexclear.pipeline.post.shapes.body_shape import has_edges

BACKGROUND, BACKGROUND_TOP = "#ffffff", "#e6ecf2"
SOFT = "#5b6570"


def plotter(size: tuple[int, int]) -> pv.Plotter:
    """An off-screen plotter. Call it only where `pipeline.post.render.gl.works()`."""
    # without a display VTK warns and then draws off-screen all the same
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    scene = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
    scene.set_background(BACKGROUND, top=BACKGROUND_TOP)
    for position, intensity in (((-2.0, 3.0, 4.0), 0.62), ((4.0, 1.0, 2.0), 0.3), ((-1.0, -4.0, 1.0), 0.35)):
        scene.add_light(pv.Light(position=position, intensity=intensity, light_type="scene light"))
    scene.add_light(pv.Light(light_type="headlight", intensity=0.35))
    return scene


def skin(points: np.ndarray, faces: np.ndarray) -> pv.PolyData:
    """Points (n, 3) joined by faces (m, corners); faces of one corner are bare points."""
    points = np.ascontiguousarray(points)
    return pv.PolyData(points) if faces.shape[1] == 1 else pv.PolyData.from_regular_faces(points, faces)


def polydata(surface: Surface) -> pv.PolyData:
    """A surface for pyvista, its normals included."""
    mesh = pv.PolyData.from_regular_faces(surface.points, surface.triangles)
    mesh.point_data["Normals"] = surface.normals.astype(np.float32)
    mesh.point_data.active_normals_name = "Normals"
    return mesh


def shading(bundle: xr.Dataset) -> dict[str, Any]:
    """How a body's skin is shaded: rods smoothly, solids with their edges, bare nodes as dots."""
    if bundle.sizes["corner"] == 1:
        return {"style": "points", "point_size": 9.0, "render_points_as_spheres": True}
    return {"smooth_shading": True, "split_sharp_edges": has_edges(bundle)}


def image(scene: pv.Plotter) -> np.ndarray:
    """The picture as it is now, as bytes, shape (height, width, 3)."""
    scene.render()  # a second screenshot would show the first one again
    return np.asarray(scene.screenshot(return_img=True))
