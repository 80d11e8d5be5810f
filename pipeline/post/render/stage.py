"""A pyvista plotter with this project's light and background, and quiet about missing displays."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger

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


def grid(points: np.ndarray) -> pv.StructuredGrid:
    """A surface out of points of shape (along, around, 3)."""
    return pv.StructuredGrid(*(np.ascontiguousarray(points[:, :, None, k]) for k in range(3)))


def image(scene: pv.Plotter) -> np.ndarray:
    """The picture as bytes, shape (height, width, 3)."""
    return np.asarray(scene.screenshot(return_img=True))
