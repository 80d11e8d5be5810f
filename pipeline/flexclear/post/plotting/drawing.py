"""Drawings of bodies as vectors, in parallel projection: a view, shaded tubes, triads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from flexclear.post.plotting.style import INK
from flexclear.post.shapes.body_shape import circle

#: direction to the light in the observer's axes: from above the left shoulder
LIGHT = np.array([-0.35, 0.65, 0.68])
AMBIENT = 0.45


@dataclass(frozen=True, slots=True)
class View:
    """A parallel projection: unit vectors to the right, upwards and to the observer, rows of `axes`, shape (3, 3)."""

    axes: np.ndarray

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on the paper of points (..., 3), shape (..., 2)."""
        return points @ self.axes[:2].T

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinate of points towards the observer, shape (...)."""
        return points @ self.axes[2]


def view(towards: np.ndarray, up: np.ndarray) -> View:
    """Return the view of an observer in direction `towards`; `up` is upwards on the paper."""
    towards_eye = towards / np.linalg.norm(towards)
    right = np.cross(up, towards_eye)
    right /= np.linalg.norm(right)
    return View(np.array([right, np.cross(towards_eye, right), towards_eye]))


def shell(
    axes: Axes, camera: View, rings: np.ndarray, values: np.ndarray | None, color: str = "#9aa5b1", **look: Any
) -> None:
    """Draw a closed tube of rings (ring, around, 3), whose first and last points coincide.

    values: one per ring in [0, 1], drawn as colours; without them the tube has one colour.
    """
    index = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    faces = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    shades = None if values is None else np.repeat(values, rings.shape[1])
    skin(axes, camera, rings.reshape(-1, 3), faces, shades, color, closed=True, **look)


def skin(
    axes: Axes,
    camera: View,
    points: np.ndarray,
    faces: np.ndarray,
    values: np.ndarray | None,
    color: str = "#9aa5b1",
    *,
    closed: bool = False,
    **look: Any,
) -> None:
    """Draw faces (m, corners) between points (n, 3), the near ones over the far ones.

    values: one per point in [0, 1], drawn as colours.  closed: True when all faces have the same orientation, so that
    those at the back are left out; else either side of a face may be the outer one.
    """
    corners = points[faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
    size = np.linalg.norm(normal, axis=1)
    volume = float(np.sum((corners.mean(axis=1) - points.mean(axis=0)) * normal))
    outward = normal / np.where(size > 0.0, size, 1.0)[:, None] @ camera.axes.T * (1.0 if volume >= 0.0 else -1.0)
    shown = (size > 0.0) & (outward[:, 2] > 0.0 if closed else True)
    light = LIGHT / np.linalg.norm(LIGHT)
    lit = outward[shown] @ light if closed else np.abs(outward[shown]) @ np.abs(light)
    corners, faces = corners[shown], faces[shown]
    base = np.array(to_rgb(color)) if values is None else colormaps["viridis"](values[faces].mean(axis=1))[:, :3]
    colors = np.clip(base * (AMBIENT + (1.0 - AMBIENT) * np.clip(lit, 0.0, 1.0))[:, None], 0.0, 1.0)
    order = np.argsort(camera.depth(corners).mean(axis=1), kind="stable")
    # edges of the faces' own colour close the gaps between them, but would show through where they are translucent
    edges = {"edgecolors": colors[order], "lw": 0.3} if "alpha" not in look else {"edgecolors": "none"}
    axes.add_collection(PolyCollection(list(camera.project(corners)[order]), facecolors=colors[order], **edges, **look))


def tube(start: np.ndarray, end: np.ndarray, radius: float, around: int = 24) -> np.ndarray:
    """Return the rings of a straight round bar with flat ends, for `shell`, shape (4, around + 1, 3)."""
    ring = radius * circle(end - start, around)
    return np.stack([start + 0.0 * ring, start + ring, end + ring, end + 0.0 * ring])


def triad(axes: Axes, camera: View, origin: np.ndarray, length: float, names: tuple[str, str, str]) -> None:
    """Draw the three axes of a frame as arrows with names."""
    start = camera.project(origin)
    for direction, name in zip(np.eye(3), names, strict=True):
        end = camera.project(origin + length * direction)
        axes.annotate(
            "",
            (end[0], end[1]),
            (start[0], start[1]),
            arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.1},
            zorder=9,
        )
        axes.annotate(
            name, end + 0.16 * (end - start), ha="center", va="center", fontsize=8.5, color=INK, annotation_clip=False
        )
