"""What a body looks like when nothing but its mass, inertia and frames is known.

Each rigid body is drawn as the uniform cylinder (or box) that has its mass and its inertia, with
arms to the frames outside it.  For rods, plates and discs that is the body itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyvista as pv

#: two principal moments closer than this share are called equal: a cylinder, not a box; tables print four digits
ROUND = 0.01
#: thinnest drawn thickness as a share of the body's largest extent, so that plates are seen
THINNEST = 0.03
#: thickness of a flat body, and distance of its joints from its axis, as shares of its radius
FLAT = 0.2


@dataclass(frozen=True, slots=True)
class Solid:
    """Equivalent solid about the centre of mass: `axes` columns are its directions in the body frame.

    round: half extents are (radius, radius, half length), else those of a box.
    """

    axes: np.ndarray
    half: np.ndarray  #: [m]
    round: bool

    def holds(self, point: np.ndarray) -> bool:
        """Whether a point relative to the centre of mass, body axes, lies inside."""
        local = np.abs(self.axes.T @ point)
        if self.round:
            return bool(np.hypot(local[0], local[1]) <= self.half[0] and local[2] <= self.half[2])
        return bool((local <= self.half).all())


def equivalent(mass: float, inertia: np.ndarray) -> Solid:
    """The uniform cylinder or box of this mass [kg] and inertia about its centre of mass [kg m^2]."""
    moments, axes = np.linalg.eigh(inertia)
    low, middle, high = moments / mass
    if high - low <= ROUND * high:  # alike about every axis: a cube shows how it turns
        return Solid(_right(axes), _visible(np.full(3, np.sqrt(1.5 * low))), round=False)
    if middle - low <= ROUND * high:
        moments, axes = moments[[0, 1, 2]], axes
    elif high - middle <= ROUND * high:
        axes = axes[:, [1, 2, 0]]
    else:
        squares = 1.5 * np.array([middle + high - low, low + high - middle, low + middle - high])
        return Solid(_right(axes), _visible(np.sqrt(np.clip(squares, 0.0, None))), round=False)
    across, along = (0.5 * (low + middle), high) if middle - low <= ROUND * high else (0.5 * (middle + high), low)
    radius = np.sqrt(2.0 * along)
    half_length = np.sqrt(3.0 * max(across - 0.25 * radius**2, 0.0))
    return Solid(_right(axes), _visible(np.array([radius, radius, half_length])), round=True)


def plate(solid: Solid, corners: np.ndarray) -> Solid:
    """A flat disc as the square plate of the same inertia, where it carries joints at the corners of a rectangle.

    corners: frame origins relative to the centre of mass, body axes, shape (n, 3).  The moments of inertia of a disc
    and of a square are alike about all axes: only what a body carries tells them apart.
    """
    if not solid.round or solid.half[2] > FLAT * solid.half[0]:
        return solid
    flat = corners - np.outer(corners @ solid.axes[:, 2], solid.axes[:, 2])
    far = flat[np.linalg.norm(flat, axis=1) > FLAT * solid.half[0]]
    centre = far - far.mean(axis=0) if len(far) == 4 else np.zeros((0, 3))
    mirrored = len(far) == 4 and np.allclose(np.sort(centre, axis=0), np.sort(-centre, axis=0), atol=1e-6)
    if not mirrored or np.ptp(np.linalg.norm(centre, axis=1)) > 1e-6:
        return solid
    others = centre[1:] - centre[0]
    side = others[int(np.argmin(np.linalg.norm(others, axis=1)))]
    x = side / np.linalg.norm(side)
    z = solid.axes[:, 2]
    # polar radius of gyration: r^2/2 of a disc, a^2/6 of a square of side a
    half = 0.5 * np.sqrt(3.0) * solid.half[0]
    return Solid(np.column_stack([x, np.cross(z, x), z]), np.array([half, half, solid.half[2]]), round=False)


def mesh(solid: Solid | None, frames: Mapping[str, np.ndarray], arm: float) -> pv.PolyData:
    """Surface of a rigid body relative to its centre of mass, body axes [m].

    frames: origins relative to the centre of mass, body axes.  arm: radius of the arms to frames
    outside the solid [m].  Without a solid only the arms are drawn.
    """
    parts = [] if solid is None else [_shape(solid)]
    for origin in frames.values():
        if np.linalg.norm(origin) > 1e-6 and (solid is None or not solid.holds(origin)):
            parts.append(pv.Line((0.0, 0.0, 0.0), origin).tube(radius=arm, n_sides=24, capping=True))
    if not parts:
        parts = [pv.Sphere(radius=2.0 * arm)]
    return pv.merge(parts).extract_surface(algorithm="dataset_surface") if len(parts) > 1 else parts[0]


def link(frames: Mapping[str, np.ndarray], width: float) -> pv.PolyData:
    """Bars between the frames of a body, with a boss at each, relative to its centre of mass, body axes [m].

    Two frames are joined by one bar; more by bars from their middle.  A body with one frame gets a bar from its centre
    of mass to that.  width: half the width of a bar [m].
    """
    places = _apart([np.asarray(origin, dtype=float) for origin in frames.values()], 0.1 * width)
    if len(places) == 1:
        places = _apart([*places, np.zeros(3)], 0.1 * width)
    if len(places) < 2:
        return pv.Sphere(radius=2.0 * width)
    middle = places[0] if len(places) == 2 else np.mean(places, axis=0)
    parts = [pv.Sphere(radius=1.35 * width, center=place) for place in places]
    parts += [
        pv.Line(middle, place).tube(radius=width, n_sides=24, capping=True)
        for place in places
        if np.linalg.norm(place - middle) > 0.1 * width
    ]
    return pv.merge(parts).extract_surface(algorithm="dataset_surface")


def _apart(places: list[np.ndarray], same: float) -> list[np.ndarray]:
    """The places, those closer than `same` to an earlier one left out."""
    found: list[np.ndarray] = []
    for place in places:
        if all(np.linalg.norm(place - other) > same for other in found):
            found.append(place)
    return found


def _shape(solid: Solid) -> pv.PolyData:
    if solid.round:
        flat = solid.half[2] < solid.half[0]
        shape = pv.Cylinder(
            center=(0, 0, 0),
            direction=solid.axes[:, 2],
            radius=float(solid.half[0]),
            height=2.0 * float(solid.half[2]),
            resolution=96 if flat else 40,
        )
    else:
        x, y, z = (float(value) for value in solid.half)
        shape = pv.Box(bounds=(-x, x, -y, y, -z, z))
        transform = np.eye(4)
        transform[:3, :3] = solid.axes
        shape = shape.transform(transform, inplace=False)
    # sharp edges keep their own normals, round walls are shaded smoothly
    return shape.triangulate().compute_normals(split_vertices=True, feature_angle=40.0)


def _visible(half: np.ndarray) -> np.ndarray:
    return np.maximum(half, THINNEST * half.max())


def _right(axes: np.ndarray) -> np.ndarray:
    return axes if np.linalg.det(axes) > 0 else axes * np.array([-1.0, 1.0, 1.0])
