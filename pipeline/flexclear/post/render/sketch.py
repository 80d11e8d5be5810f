"""A small picture of a mechanism without GL libraries: its triangles from the farthest to the nearest."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from flexclear.post.plotting import style
from flexclear.post.render.layout import part_pose
from flexclear.post.render.mechanism import Mechanism
from flexclear.post.render.view import ANGLE, axes_of, eye

#: width and height [pixels]; brightness of a face seen from the side
SIZE, SHADE = (440, 300), 0.5


def sketch(drawn: Mechanism) -> np.ndarray:
    """Draw the parts at the first output, pixels of shape (height, width, 3); flexible bodies must be among the
    parts."""
    position, focus = eye(drawn.view, drawn.cloud, SIZE[0] / SIZE[1], drawn.looks.zoom)
    axes = axes_of(drawn.view, position, focus)
    corners, colors = [np.empty((0, 3, 3))], [np.empty((0, 4))]
    for part in drawn.parts:
        matrix = part_pose(drawn.run, part, 0)
        points = (part.surface.points @ matrix[:3, :3].T + matrix[:3, 3] - position) @ axes
        triangles = points[part.surface.triangles]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        facing = np.abs(normals[:, 2]) / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
        shaded = (SHADE + (1.0 - SHADE) * facing)[:, None] * np.array(to_rgb(part.color))
        corners.append(triangles)
        colors.append(np.column_stack([shaded, np.full(len(shaded), part.opacity)]))
    triangles, color = np.concatenate(corners), np.concatenate(colors)
    order = np.argsort(triangles[:, :, 2].mean(axis=1))  # the eye looks along -z
    canvas, slope = style.canvas(SIZE), np.tan(0.5 * np.radians(ANGLE))
    picture = canvas.figure.add_axes((0.0, 0.0, 1.0, 1.0))
    picture.set_axis_off()
    picture.set(xlim=(-slope * SIZE[0] / SIZE[1], slope * SIZE[0] / SIZE[1]), ylim=(-slope, slope))
    flat = (triangles[:, :, :2] / -triangles[:, :, 2:])[order]
    # edges in the colour of their face, so that no gap is seen between faces
    picture.add_collection(PolyCollection(flat, facecolors=color[order], edgecolors=color[order], linewidths=0.4))
    canvas.draw()
    return style.pixels(canvas)
