"""Shapes of rigid bodies: bars, plates and blocks between their joints.

Mass and inertia determine little of a shape: the uniform cylinder with the inertia of a crank is a drum that hides the
mechanism. So bodies are drawn as links between their joints, and the inertia only gives the thickness of slender bars,
the radius of discs, and the size of bodies without joints.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.post.render import surfaces
from flexclear.post.render.surfaces import Surface
from flexclear.scene.fields import Pose
from flexclear.scene.loose_joints import SURFACES
from flexclear.system.errors import InputError
from flexclear.system.external_files import read_mesh

#: half width of a link as a fraction of the mechanism's size, and at most of the distance of its joints
WIDTH, WIDEST = 0.016, 0.2
#: thickness of flat links, in half widths
FLAT = 0.9
#: points closer to each other than this many half widths are one
NEAR = 0.3
#: a solid is slender where its length is so many times its thickness
SLENDER = 2.5
#: largest half extent of a body without separate joints, as a fraction of the mechanism's size
LARGEST = 0.1
#: joints that turn about z of their frames, and that slide along it
TURNING = (
    "revolute",
    "slot",
    "planar",
    *(name for name, kind in SURFACES.items() if kind.ideal in ("revolute", "slot")),
)
SLIDING = (
    "prismatic",
    "cylindrical",
    *(name for name, kind in SURFACES.items() if kind.ideal in ("prismatic", "cylindrical")),
)
BALLS = ("spherical", *(name for name, kind in SURFACES.items() if kind.ideal == "spherical" or not kind.hollow))
#: frames on a body at which a load acts, and at which nothing does
LOADED, BARE = "load", "frame"
#: two principal moments closer than this fraction are called equal: a cylinder, not a box; tables print four digits
ROUND = 0.01
#: largest file of a surface [bytes], since larger ones take too long to draw; and largest coordinate of its points [m]
LARGEST_FILE, FARTHEST = 200_000_000, 1e15
#: faces of cells, by their corners, seen from outside
_SIDES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}


@dataclass(frozen=True, slots=True)
class Seat:
    """A frame on a body: name, origin and axes in the body's axes, type of its joint (or LOADED, BARE), True for the
    first side."""

    frame: str
    origin: np.ndarray
    axes: np.ndarray
    joint: str
    first: bool


@dataclass(frozen=True, slots=True)
class Solid:
    """Equivalent solid about the centre of mass: `axes` columns are its directions in the body frame.

    round: half extents are (radius, radius, half length), else those of a box.
    """

    axes: np.ndarray
    half: np.ndarray  #: [m]
    round: bool


def equivalent_solid(mass: float, inertia: np.ndarray) -> Solid:
    """Return the uniform cylinder or box of this mass [kg] and inertia about its centre of mass [kg m^2]."""
    moments, axes = np.linalg.eigh(inertia)
    low, middle, high = moments / mass
    if high - low <= ROUND * high:  # equal moments: a cube shows rotations
        return Solid(_right_handed(axes), _not_too_thin(np.full(3, np.sqrt(1.5 * low))), round=False)
    if middle - low <= ROUND * high:
        across, along = 0.5 * (low + middle), high
    elif high - middle <= ROUND * high:
        across, along, axes = 0.5 * (middle + high), low, axes[:, [1, 2, 0]]
    else:
        squares = 1.5 * np.array([middle + high - low, low + high - middle, low + middle - high])
        return Solid(_right_handed(axes), _not_too_thin(np.sqrt(np.clip(squares, 0.0, None))), round=False)
    radius = np.sqrt(2.0 * along)
    half_length = np.sqrt(3.0 * max(across - 0.25 * radius**2, 0.0))
    return Solid(_right_handed(axes), _not_too_thin(np.array([radius, radius, half_length])), round=True)


def _not_too_thin(half: np.ndarray) -> np.ndarray:
    # 0.03: thinnest drawn thickness as a fraction of the body's largest extent, so that plates are visible
    return np.maximum(half, 0.03 * half.max())


def _right_handed(axes: np.ndarray) -> np.ndarray:
    return axes if np.linalg.det(axes) > 0 else axes * np.array([-1.0, 1.0, 1.0])


def link(seats: Sequence[Seat], com: np.ndarray, solid: Solid | None, size: float, layer: int = 0) -> Surface:
    """Return the surface of a body in its own axes [m]; empty where the balls of the joints are enough.

    com: centre of mass [m].  solid: equivalent solid about it, or None.  size: of the mechanism [m].  layer: counts
    bodies, so that flat links in one plane have different thicknesses and their faces do not coincide.
    """
    used = [seat for seat in seats if seat.joint != BARE]
    joined = [seat for seat in used if seat.joint not in ("fixed", LOADED)]
    joined = joined or [seat for seat in used if seat.joint != LOADED]
    points = _distinct([seat.origin for seat in (*joined, *used)], NEAR * WIDTH * size)
    if len(points) < 2:
        far = _points_of_other_frames(points, seats, joined, com, solid, size)
        if len(far) < 2:
            return _surface_without_joints(joined, points, com, solid, size)
        points = far
    spans = np.linalg.norm(points[:, None] - points[None], axis=-1)
    width = min(WIDTH * size, WIDEST * float(spans.max()))
    normal = _common_axis(joined)
    if normal is not None and np.ptp(points @ normal) < width:
        return _plate(points, normal, width, layer)
    axis = _line(points, width)
    if axis is not None:
        low, high = points[np.argmin(points @ axis)], points[np.argmax(points @ axis)]
        return surfaces.bar(low, high, _bar_radius(solid, axis, width))
    flat = _plane(points, width)
    if flat is not None:
        return _plate(points, flat, 1.3 * width, layer)
    middle = points.mean(axis=0)
    bars = [surfaces.bar(middle, point, 0.8 * width) for point in points if np.linalg.norm(point - middle) > width]
    return surfaces.join([surfaces.place(surfaces.sphere(1.2 * width), middle), *bars])


def _points_of_other_frames(
    points: np.ndarray, seats: Sequence[Seat], joined: Sequence[Seat], com: np.ndarray, solid: Solid | None, size: float
) -> np.ndarray:
    """Return points that show a body with one joint, or none, by its other frames too; empty where a block, a wheel or
    its equivalent solid shows it better."""
    arm = len(points) > 0 and np.linalg.norm(com - points[0]) > 1.5 * WIDTH * size
    kinds = {seat.joint for seat in joined}
    if (solid is not None and not joined) or (not arm and kinds & {*SLIDING, *TURNING}):
        return np.empty((0, 3))
    frames = _distinct([*points, *(seat.origin for seat in seats)], NEAR * WIDTH * size)
    return _distinct([*frames, com], NEAR * WIDTH * size) if arm and len(frames) > 1 else frames


def shapes(declared: Sequence[Mapping[str, Any]], folder: Path) -> Surface:
    """Return the shapes that a scene gives for a body, in the body frame [m]; files are relative to `folder`.

    Raises InputError for files that cannot be read.
    """
    drawn = []
    for shape in declared:
        kind = shape["type"]
        if kind == "box":
            part = surfaces.box(shape["size"])
        elif kind == "cylinder":
            part = surfaces.cylinder(shape["radius"], shape["length"])
        elif kind == "sphere":
            part = surfaces.sphere(shape["radius"])
        else:
            part = read(folder / shape["file"], float(shape.get("unit", 1.0)))
        pose = Pose.model_validate(shape.get("pose", {}))
        drawn.append(surfaces.place(part, np.array(pose.position), quaternion_to_matrix(pose.as_quaternion())))
    return surfaces.join(drawn)


def _surface_without_joints(
    seats: Sequence[Seat], points: np.ndarray, com: np.ndarray, solid: Solid | None, size: float
) -> Surface:
    """Return the surface of a body without joints, or with all joints at one point."""
    width = WIDTH * size
    point = points[0] if len(points) else com
    arm = com - point
    reach = float(np.linalg.norm(arm))
    kinds = [seat.joint for seat in seats]
    if reach > 1.5 * width:
        return _arm(point, com, solid, width)
    slide = next((seat for seat in seats if seat.joint in SLIDING), None)
    if slide is not None:
        block = surfaces.box((3.0 * width, 3.0 * width, 4.4 * width))
        return surfaces.place(block, point, slide.axes)
    wheel = next((seat for seat in seats if seat.joint in TURNING), None)
    if wheel is not None:
        return surfaces.place(_wheel(solid, wheel.axes[:, 2], size), point, surfaces.axes_along(wheel.axes[:, 2]))
    if any(kind in BALLS for kind in kinds):
        return surfaces.EMPTY
    if solid is None:
        return surfaces.place(surfaces.sphere(2.0 * width), point)
    half = solid.half * min(1.0, LARGEST * size / float(solid.half.max()))
    if kinds and np.ptp(half) <= 1e-9 * half.max():  # equal moments and fixed to something: a ball
        return surfaces.place(surfaces.sphere(float(half[0])), com)
    part = surfaces.cylinder(half[0], 2.0 * half[2]) if solid.round else surfaces.box(tuple(2.0 * half))
    return surfaces.place(part, com, solid.axes)


def _arm(point: np.ndarray, com: np.ndarray, solid: Solid | None, width: float) -> Surface:
    """Return a body that hangs on one joint: a bar where its inertia is that of one, else a bob on an arm."""
    axis = (com - point) / np.linalg.norm(com - point)
    half = 0.0 if solid is None else float(solid.half.max())
    if solid is not None and _is_slender(solid, axis) and half < 1.5 * np.linalg.norm(com - point):
        far = com + half * axis
        return surfaces.bar(point, far, _bar_radius(solid, axis, width))
    radius = 2.4 * width if solid is None else float(np.clip(0.8 * half, 1.8 * width, 4.0 * width))
    return surfaces.join([surfaces.bar(point, com, 0.7 * width), surfaces.place(surfaces.sphere(radius), com)])


def wheel_of_gear(seat: Seat, radius: float, size: float, *, inner: bool) -> Surface:
    """Return a gear's wheel in its body's axes [m], as large as its pitch circle; inner: a ring with teeth inwards."""
    width, axes = WIDTH * size, surfaces.axes_along(seat.axes[:, 2])
    if not inner:
        return surfaces.place(_disc(radius, width), seat.origin, axes)
    middle = np.array([radius + 0.5 * width, 0.0, 0.0])
    mark = surfaces.place(surfaces.box((0.8 * width, 0.5 * width, 1.3 * width)), middle)
    return surfaces.place(surfaces.join([ring(radius, radius + width, width), mark]), seat.origin, axes)


def ring(inner: float, outer: float, thick: float) -> Surface:
    """Return a ring about z."""
    half = 0.5 * thick
    profile = np.array([[inner, -half], [outer, -half], [outer, half], [inner, half], [inner, -half]])
    return surfaces.revolve(profile, 4 * surfaces.ROUND)


def coil(radius: float, length: float, wire: float) -> Surface:
    """Return a helical spring along z from the origin; it begins and ends on the axis."""
    turns = int(np.clip(length / (1.2 * radius), 3, 10))
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 20 * turns)
    height = length * np.linspace(0.12, 0.88, angle.size)
    helix = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    return surfaces.tube(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, helix[0, 2]], *helix, [0.0, 0.0, helix[-1, 2]],
                                   [0.0, 0.0, length]]), wire)  # fmt: skip


def _wheel(solid: Solid | None, axis: np.ndarray, size: float) -> Surface:
    """Return a disc about z with a mark that shows its rotation."""
    width = WIDTH * size
    radius = 3.0 * width
    if solid is not None and solid.round and abs(solid.axes[:, 2] @ axis) > 0.99:
        radius = float(np.clip(solid.half[0], 2.4 * width, LARGEST * size))
    return _disc(radius, width)


def _disc(radius: float, width: float) -> Surface:
    mark = surfaces.place(surfaces.box((0.7 * radius, 0.5 * width, 1.3 * width)), np.array([0.55 * radius, 0.0, 0.0]))
    return surfaces.join([surfaces.cylinder(radius, width), mark])


def _bar_radius(solid: Solid | None, axis: np.ndarray, width: float) -> float:
    """Return the radius of a bar along an axis: that of the slender solid with its inertia, within visible limits."""
    if solid is None or not _is_slender(solid, axis):
        return 0.8 * width
    return float(np.clip(np.sort(solid.half)[1], 0.4 * width, 1.7 * width))


def _is_slender(solid: Solid, axis: np.ndarray) -> bool:
    longest = solid.axes[:, int(solid.half.argmax())]
    return float(solid.half.max()) > SLENDER * float(np.sort(solid.half)[1]) and abs(float(longest @ axis)) > 0.95


def _plate(points: np.ndarray, normal: np.ndarray, width: float, layer: int) -> Surface:
    axes = surfaces.axes_along(normal)
    middle = points.mean(axis=0)
    flat = (points - middle) @ axes
    thickness = FLAT * width * (1.0 - 0.12 * (layer % 5))
    return surfaces.place(surfaces.prism(surfaces.hull(flat[:, :2], width), thickness), middle, axes)


def _common_axis(seats: Sequence[Seat]) -> np.ndarray | None:
    """Return the axis about which all joints of a body turn (slides across it are allowed), or None."""
    axes = [seat.axes[:, 2] for seat in seats if seat.joint in TURNING]
    if not axes or any(abs(axis @ axes[0]) < 0.999 for axis in axes):
        return None
    slides = [seat.axes[:, 2] for seat in seats if seat.joint in SLIDING]
    others = [seat for seat in seats if seat.joint not in (*TURNING, *SLIDING, *BALLS, LOADED)]
    return None if others or any(abs(axis @ axes[0]) > 0.05 for axis in slides) else axes[0]


def _line(points: np.ndarray, width: float) -> np.ndarray | None:
    """Return the direction of a line on which all points lie, or None."""
    offsets = points - points.mean(axis=0)
    _, size, axes = np.linalg.svd(offsets, full_matrices=False)
    return axes[0] if len(size) < 2 or size[1] < 0.5 * width else None


def _plane(points: np.ndarray, width: float) -> np.ndarray | None:
    """Return the normal of a plane in which all points lie, or None."""
    _, size, axes = np.linalg.svd(points - points.mean(axis=0))
    return axes[2] if len(size) < 3 or size[2] < 0.5 * width else None


def _distinct(points: Sequence[np.ndarray], same: float) -> np.ndarray:
    """Return the points without those closer than `same` to an earlier one, shape (n, 3)."""
    offsets: list[np.ndarray] = []
    for point in points:
        if all(np.linalg.norm(point - other) > same for other in offsets):
            offsets.append(point)
    return np.array(offsets).reshape(-1, 3)


def read(path: Path, unit: float) -> Surface:
    """Return the surface in a file that meshio reads; tetrahedra and hexahedra give their boundary."""
    remedy = "give an STL, VTK, PLY or OBJ file"
    mesh = read_mesh(path, f"{path}", "is not a surface that can be drawn", remedy, LARGEST_FILE)
    faces = []
    for block in mesh.cells:
        if block.type in ("triangle", "quad"):
            faces.append(surfaces.triangulate(block.data.astype(int)))
        elif block.type in _SIDES:
            faces.append(_boundary(block.data.astype(int), _SIDES[block.type]))
    if not faces:
        raise InputError(f"{path}", "has no triangles, quadrangles, tetrahedra or hexahedra", "export a surface")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = unit * mesh.points
    triangles = np.concatenate(faces)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(points)):
        raise InputError(f"{path}", f"its faces refer to points beyond its {len(points)} ones", "export it again")
    if not np.abs(points).max(initial=0.0) < FARTHEST:
        raise InputError(f"{path}", "its points are not finite numbers, or too large to be drawn", "export it again")
    return surfaces.with_normals(points, triangles, sharp=True)


def _boundary(cells: np.ndarray, sides: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Return triangles of the faces that belong to one cell only."""
    faces = cells[:, list(sides)].reshape(-1, len(sides[0]))
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return surfaces.triangulate(faces[first[count == 1]])


#: function of a frame's name that returns origin [m] and axes in the world, at the start
Placed = Callable[[str], tuple[np.ndarray, np.ndarray]]
#: joint types on which a wheel turns
WHEELED = ("revolute", "cylindrical")
#: relative tolerance within which axes are parallel, radii equal and ratios one
SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel on a joint's second frame; radius of its pitch circle [m]; inner: True for teeth inwards."""

    frame: str
    radius: float
    inner: bool = False


def wheels(given: Mapping[str, Any], placed: Placed) -> dict[str, list[Wheel]]:
    """Return wheels by body, of gears between parallel axes and between a wheel and a rack.

    given: parameters of the run.  The pitch circles of `first` and `second` touch: the ratio of speeds gives the ratio
    of their radii, and the axes the distance of their centres.
    """
    found: dict[str, list[Wheel]] = {}
    for gear in given.get("gear", {}).values():
        for wheel in _pair(given["joint"], gear, placed):
            mine = found.setdefault(wheel.frame.partition(".")[0], [])
            if all(abs(wheel.radius - other.radius) > SAME * wheel.radius for other in mine):
                mine.append(wheel)
    return found


def _pair(joints: Mapping[str, Any], gear: Mapping[str, Any], placed: Placed) -> list[Wheel]:
    sides = [joints.get(gear[side].partition(".")[0]) for side in ("first", "second")]
    if None in sides or not isinstance(gear["ratio"], float | int):
        return []
    frames = [str(joint["between"][1]) for joint in sides if joint]
    turns = [bool(joint and joint["type"] in WHEELED and not gear[side].endswith(".translation"))
             for joint, side in zip(sides, ("first", "second"), strict=True)]  # fmt: skip
    ratio = float(gear["ratio"])
    if turns == [True, False]:
        return [Wheel(frames[0], abs(ratio))]
    if turns == [False, True]:
        return [Wheel(frames[1], 1.0 / abs(ratio))] if ratio else []
    (p, P), (q, Q) = (placed(frame) for frame in frames)
    along = float(P[:, 2] @ Q[:, 2])
    away = q - p
    distance = float(np.linalg.norm(away - (away @ P[:, 2]) * P[:, 2]))
    if turns != [True, True] or abs(abs(along) - 1.0) > SAME or distance == 0.0 or not ratio:
        return []
    ratio *= np.sign(along)
    if ratio < 0.0:
        second = distance / (1.0 - ratio)
        return [Wheel(frames[0], -ratio * second), Wheel(frames[1], second)]
    if abs(ratio - 1.0) < SAME:
        return []  # pulleys of a belt may have any size
    second = distance / abs(ratio - 1.0)
    return [Wheel(frames[0], ratio * second, inner=ratio > 1.0), Wheel(frames[1], second, inner=ratio < 1.0)]
