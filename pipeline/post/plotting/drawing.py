"""Drawings of bodies as vectors, in parallel projection: a view, shaded tubes, triads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from flexclear.pipeline.post.plotting.style import INK
from flexclear.pipeline.post.shapes.rod_shape import circle

#: direction of the light, seen by the observer: from above his left shoulder
LIGHT = np.array([-0.35, 0.65, 0.68])
AMBIENT = 0.45


@dataclass(frozen=True, slots=True)
class View:
    """A parallel projection: unit vectors to the right, upwards and to the observer, rows of `axes`, shape (3, 3)."""

    axes: np.ndarray

    def project(self, points: np.ndarray) -> np.ndarray:
        """Places on the paper of points (..., 3), shape (..., 2)."""
        return points @ self.axes[:2].T

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How near points are to the observer, shape (...)."""
        return points @ self.axes[2]


def view(towards: np.ndarray, up: np.ndarray) -> View:
    """The view of an observer in direction `towards`; `up` is upwards on the paper."""
    towards_eye = towards / np.linalg.norm(towards)
    right = np.cross(up, towards_eye)
    right /= np.linalg.norm(right)
    return View(np.array([right, np.cross(towards_eye, right), towards_eye]))


def shell(
    axes: Axes, seen: View, rings: np.ndarray, values: np.ndarray | None, color: str = "#9aa5b1", **look: Any
) -> None:
    """A closed tube of rings (ring, around, 3), the last point of each its first; far faces are hidden by near ones.

    values: one per ring in [0, 1], drawn as colours; without them the tube has one colour.
    """
    corners = np.stack([rings[:-1, :-1], rings[1:, :-1], rings[1:, 1:], rings[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    size = np.linalg.norm(normal, axis=1)
    normal = normal[size > 0.0] / size[size > 0.0, None]
    outward = normal @ seen.axes.T
    # which way the rings run round decides which way normals point
    outward *= _outwards(rings, normal, corners[size > 0.0])
    if values is None:
        base = np.tile(to_rgb(color), (len(corners), 1))
    else:
        middles = np.repeat(0.5 * (values[:-1] + values[1:]), rings.shape[1] - 1)
        base = colormaps["viridis"](middles)[:, :3]
    base, corners = base[size > 0.0], corners[size > 0.0]
    facing = outward[:, 2] > 0.0
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(outward @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    colors = np.clip(base * light[:, None], 0.0, 1.0)[facing]
    depth = seen.depth(corners[facing]).mean(axis=1)
    order = np.argsort(depth, kind="stable")
    # edges of the faces' own colour close the gaps between them, but would show through where they are translucent
    edges = {"edgecolors": colors[order], "lw": 0.3} if "alpha" not in look else {"edgecolors": "none"}
    faces = PolyCollection(list(seen.project(corners[facing])[order]), facecolors=colors[order], **edges, **look)
    axes.add_collection(faces)


def skin(axes: Axes, seen: View, points: np.ndarray, triangles: np.ndarray, values: np.ndarray, **look: Any) -> None:
    """Triangles (m, 3) between points (n, 3), the near ones before the far ones; values: one per point in [0, 1]."""
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    there = size > 0.0
    toward = np.abs(normal[there] / size[there, None] @ seen.axes.T)  # either side may be the outer one
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(toward @ np.abs(LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    colors = np.clip(colormaps["viridis"](values[triangles[there]].mean(axis=1))[:, :3] * light[:, None], 0.0, 1.0)
    order = np.argsort(seen.depth(corners[there]).mean(axis=1), kind="stable")
    faces = seen.project(corners[there])[order]
    axes.add_collection(PolyCollection(list(faces), facecolors=colors[order], edgecolors=colors[order], lw=0.3, **look))


def _outwards(rings: np.ndarray, normal: np.ndarray, corners: np.ndarray) -> float:
    """+1 where the normals point out of the tube, else -1."""
    centre = np.repeat(rings[:-1, :-1].mean(axis=1)[:, None], rings.shape[1] - 1, axis=1).reshape(-1, 3)
    sides = np.linalg.norm(
        np.cross(rings[1:, :-1] - rings[:-1, :-1], rings[:-1, 1:] - rings[:-1, :-1]), axis=-1
    ).ravel()
    visible = centre[: len(sides)][sides > 0.0]
    n = min(len(visible), len(normal))
    return 1.0 if ((corners[:n].mean(axis=1) - visible[:n]) * normal[:n]).sum() >= 0.0 else -1.0


def tube(start: np.ndarray, end: np.ndarray, radius: float, around: int = 24) -> np.ndarray:
    """Rings of a straight round bar with flat ends, for `shell`, shape (4, around + 1, 3)."""
    ring = radius * circle(end - start, around)
    return np.stack([start + 0.0 * ring, start + ring, end + ring, end + 0.0 * ring])


def triad(axes: Axes, seen: View, origin: np.ndarray, length: float, names: tuple[str, str, str]) -> None:
    """The three axes of a frame as arrows with names."""
    start = seen.project(origin)
    for direction, name in zip(np.eye(3), names, strict=True):
        end = seen.project(origin + length * direction)
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
