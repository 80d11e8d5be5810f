"""Triangulated surfaces of simple solids, with normals; pure numbers for any drawing library.

Edges are sharp: points are repeated where two faces meet at an angle, each with the normal of its face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: corners of round shapes
ROUND = 32


@dataclass(frozen=True, slots=True)
class Surface:
    """points, normals [m, -], shape (n, 3); triangles: indices of points, anticlockwise from outside, shape (m, 3)."""

    points: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray


EMPTY = Surface(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3), dtype=int))


def join(parts: Sequence[Surface]) -> Surface:
    """Join several surfaces into one."""
    if not parts:
        return EMPTY
    offsets = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    return Surface(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + offset for part, offset in zip(parts, offsets, strict=True)]),
    )


def place(surface: Surface, origin: np.ndarray, axes: np.ndarray | None = None) -> Surface:
    """Return the surface of a frame with this origin [m] and these axes (columns), in axes of the frame's parent."""
    R = np.eye(3) if axes is None else axes
    return Surface(surface.points @ R.T + origin, surface.normals @ R.T, surface.triangles)


def axes_along(direction: np.ndarray) -> np.ndarray:
    """Return right-handed axes, columns, whose z is a direction, shape (3, 3)."""
    z = direction / np.linalg.norm(direction)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def prism(outline: np.ndarray, thickness: float) -> Surface:
    """Extrude a convex outline, anticlockwise, shape (n, 2), along z by `thickness`, the middle at z = 0."""
    n, h = len(outline), 0.5 * thickness
    centre = outline.mean(axis=0)
    edge = np.roll(outline, -1, axis=0) - outline
    flat = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(edge, axis=1)[:, None]
    pairs = np.stack([flat, flat], axis=1)
    ends = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
    wall = np.concatenate([_points_at_height(ends, -h), _points_at_height(ends, h)], axis=1).reshape(-1, 3)
    normal = np.concatenate([_points_at_height(pairs, 0.0), _points_at_height(pairs, 0.0)], axis=1).reshape(-1, 3)
    k = 4 * np.arange(n)[:, None, None]
    walls = Surface(wall, normal, (k + np.array([[0, 1, 3], [0, 3, 2]])).reshape(-1, 3))
    return join([walls, *(_cap(outline, centre, side * h, side) for side in (1.0, -1.0))])


def hull(positions: np.ndarray, margin: float) -> np.ndarray:
    """Return the outline, anticlockwise, (m, 2), at a distance `margin` from points in a plane, (n, 2)."""
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    circle = margin * np.column_stack([np.cos(turn), np.sin(turn)])
    spread = (positions[:, None, :] + circle).reshape(-1, 2)
    ordered = spread[np.lexsort((spread[:, 1], spread[:, 0]))]
    return np.array([*_below(ordered), *_below(ordered[::-1])])


def _below(points: np.ndarray) -> list[np.ndarray]:
    """Return the points of a convex chain from the first to the one before the last, the others at its left.

    Andrew's algorithm: scipy, which has another, takes longer to import than a page takes to draw.
    """
    chain = list[np.ndarray]()
    tiny = 1e-12 * float(np.ptp(points, axis=0).max()) ** 2
    for point in points:
        while len(chain) > 1 and np.linalg.det([chain[-1] - chain[-2], point - chain[-2]]) <= tiny:
            chain.pop()
        chain.append(point)
    return chain[:-1]


def revolve(profile: np.ndarray, corners: int = ROUND) -> Surface:
    """Return a surface of revolution about z, round there and with sharp edges along its profile.

    profile: radius and height of points [m], shape (n, 2), from the lower end to the upper one along the outside.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, corners + 1)
    across = np.column_stack([np.cos(turn), np.sin(turn)])[None] * np.ones((2, 1, 1))
    bands = []
    for ends in np.stack([profile[:-1], profile[1:]], axis=1):
        radial, upwards = (ends[1] - ends[0]) @ [[0.0, -1.0], [1.0, 0.0]] / np.linalg.norm(ends[1] - ends[0])
        points = np.concatenate([ends[:, None, :1] * across, np.repeat(ends[:, None, 1:], corners + 1, axis=1)], axis=2)
        normals = np.insert(radial * across, 2, upwards, axis=2)
        bands.append(Surface(points.reshape(-1, 3), normals.reshape(-1, 3), grid(2, corners + 1)[:, ::-1]))
    return join(bands)


def cylinder(radius: float, length: float) -> Surface:
    """Return a cylinder about the origin, its axis along z."""
    half = 0.5 * length
    return revolve(np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]]))


def box(size: Sequence[float]) -> Surface:
    """Return a box about the origin."""
    x, y = 0.5 * size[0], 0.5 * size[1]
    return prism(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]), size[2])


def sphere(radius: float) -> Surface:
    """Return a sphere about the origin."""
    across = ROUND // 2
    theta, phi = np.meshgrid(
        np.linspace(0.0, np.pi, across + 1), np.linspace(0.0, 2.0 * np.pi, ROUND + 1), indexing="ij"
    )
    normals = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return Surface(radius * normals.reshape(-1, 3), normals.reshape(-1, 3), grid(across + 1, ROUND + 1))


def bar(start: np.ndarray, end: np.ndarray, radius: float) -> Surface:
    """Return a round bar with flat ends."""
    axis = end - start
    return place(cylinder(radius, float(np.linalg.norm(axis))), 0.5 * (start + end), axes_along(axis))


def cone(base: np.ndarray, tip: np.ndarray, radius: float) -> Surface:
    """Return a round cone, closed below."""
    side = revolve(np.array([[0.0, 0.0], [radius, 0.0], [0.0, np.linalg.norm(tip - base)]]))
    return place(side, base, axes_along(tip - base))


def tube(positions: np.ndarray, radius: float, corners: int = 6) -> Surface:
    """Return a thin round tube through points, shape (n, 3), open at its ends; repeated points are left out."""
    distinct = np.concatenate([[True], np.linalg.norm(np.diff(positions, axis=0), axis=1) > 1e-3 * radius])
    positions = positions[distinct]
    if len(positions) < 2:
        return place(sphere(radius), positions[0])
    tangents = np.gradient(positions, axis=0)
    across = np.empty_like(positions)
    side = axes_along(tangents[0])[:, 0]
    for k, tangent in enumerate(_unit(tangents)):  # the side is carried along, so that the tube does not twist
        rest = side - (side @ tangent) * tangent
        size = float(np.linalg.norm(rest))
        side = rest / size if size > 1e-6 else axes_along(tangent)[:, 0]
        across[k] = side
    other = np.cross(_unit(tangents), across)
    turn = np.linspace(0.0, 2.0 * np.pi, corners + 1)[None, :, None]
    normals = across[:, None] * np.cos(turn) + other[:, None] * np.sin(turn)
    points = positions[:, None] + radius * normals
    return Surface(points.reshape(-1, 3), normals.reshape(-1, 3), grid(len(positions), corners + 1)[:, ::-1])


def reach(points: np.ndarray, triangles: np.ndarray, height: float) -> float:
    """Return the largest distance from the z axis in the section of a surface at a height; 0 without a section."""
    start, end = points[triangles], points[np.roll(triangles, -1, axis=1)]
    part = (height - start[..., 2]) / np.where(start[..., 2] == end[..., 2], np.inf, end[..., 2] - start[..., 2])
    cut = (start + part[..., None] * (end - start))[(part > 0.0) & (part < 1.0)]
    return float(np.linalg.norm(cut[:, :2], axis=1).max(initial=0.0))


def grid(rows: int, columns: int) -> np.ndarray:
    """Return triangles between points in rows and columns, shape (2 (rows - 1) (columns - 1), 3)."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2).reshape(-1, 3)


def triangulate(faces: np.ndarray) -> np.ndarray:
    """Return faces of three or four corners as triangles, shape (m, 3); bare points and lines give none."""
    if faces.shape[1] < 3:
        return np.empty((0, 3), dtype=int)
    return faces if faces.shape[1] == 3 else np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


def with_normals(points: np.ndarray, triangles: np.ndarray, *, sharp: bool = False) -> Surface:
    """Add normals to points and triangles: averaged over each point's triangles, or of each triangle where `sharp`."""
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if sharp:
        return Surface(
            corners.reshape(-1, 3), np.repeat(_unit(normal), 3, axis=0), np.arange(3 * len(corners)).reshape(-1, 3)
        )
    total = np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], normal)
    return Surface(points, _unit(total), triangles)


def _unit(vectors: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(size > 0.0, vectors / np.where(size > 0.0, size, 1.0), np.array([0.0, 0.0, 1.0]))


def _points_at_height(flat: np.ndarray, height: float) -> np.ndarray:
    """Return points in the plane (..., 2) with their z."""
    return np.concatenate([flat, np.full((*flat.shape[:-1], 1), height)], axis=-1)


def _cap(outline: np.ndarray, centre: np.ndarray, height: float, side: float) -> Surface:
    n = len(outline)
    points = _points_at_height(np.vstack([outline, centre]), height)
    ring = np.arange(n)
    order = [np.full(n, n), ring, np.roll(ring, -1)] if side > 0.0 else [np.full(n, n), np.roll(ring, -1), ring]
    return Surface(points, np.tile([0.0, 0.0, side], (n + 1, 1)), np.column_stack(order))
