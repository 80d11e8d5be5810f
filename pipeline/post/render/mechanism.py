"""A run as moving solids: which bodies, joints and rods there are, and where they are at one output."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr

from flexclear.pipeline.core.algebra import quaternion_to_matrix
from flexclear.pipeline.core.scene.fields import Pose
from flexclear.pipeline.post.body_shape import scale_to, surface
from flexclear.pipeline.post.render.solids import Solid, equivalent, link, mesh, plate
from flexclear.pipeline.post.render.view import View, view
from flexclear.pipeline.post.series import parameters

#: one colour per kind of body: bodies of equal mass and inertia look alike
COLORS = ("#5b7fa6", "#b9c2cc", "#c9a66b", "#8a9a5b", "#7d6b91", "#6fa8a0", "#a0736b")
JOINT_COLOR, SOCKET_COLOR, CLEARANCE_COLOR, IMPACT_COLOR = "#3b4754", "#a9bccf", "#E69F00", "#d7191c"
#: joint spheres as a share of the mechanism's size, where no ball radius is known
JOINT_SHARE = 0.03
#: radius of the arms from a body to its frames, as a share of the mechanism's size
ARM_SHARE = 0.014
#: half width of links, radius of pins, and largest half extent of a body with one place, as shares of it
LINK_SHARE, PIN_SHARE, LARGEST_LONE = 0.016, 0.014, 0.12
#: a solid is slender where it is so many times longer than thick
SLENDER = 2.5
#: size of what has none: one body that rests [m]
LONE = 1.0
#: a body with at most so many frames that surrounds a joint is drawn translucent: it is the joint's socket
SOCKET_FRAMES = 3
#: largest drawn deformation as a share of the body's length
DEFORMATION_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class Rigid:
    """A rigid body: mesh about its centre of mass, index in the run."""

    index: int
    mesh: pv.PolyData
    color: str
    opacity: float


@dataclass(frozen=True, slots=True)
class Flexible:
    """A flexible body: its bundle, index in the run, columns of its modal coordinates, drawn exaggeration."""

    index: int
    bundle: xr.Dataset
    columns: np.ndarray
    scale: float


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere at a spherical joint; `contact` is its column among the contacts, if it has clearance."""

    frame: int
    radius: float
    contact: int | None


@dataclass(frozen=True, slots=True)
class Pin:
    """A pin of a joint that turns about one axis: its frame, mesh about it, index of the body that it turns with."""

    frame: int
    owner: int | None  #: None for the world
    mesh: pv.PolyData
    contact: int | None


@dataclass(frozen=True, slots=True)
class Mechanism:
    """All that is drawn of one run."""

    run: xr.Dataset
    rigid: tuple[Rigid, ...]
    flexible: tuple[Flexible, ...]
    balls: tuple[Ball, ...]
    pins: tuple[Pin, ...]
    view: View
    centre: np.ndarray
    size: float  #: diagonal of the box of all frames and of the flexible bodies at the start [m]


def mechanism(
    run: xr.Dataset, bundles: Mapping[str, xr.Dataset], direction: Sequence[float] | None = None
) -> Mechanism:
    """The drawn mechanism of a run; bundles by name of the flexible body, direction as of `render.view`."""
    told = parameters(run)
    flexible = tuple(_flexible(run, name, bundle) for name, bundle in bundles.items() if name in run.body.values)
    places = run.frame_position.values if run.sizes.get("frame", 0) else run.position.values
    shown = np.concatenate([places.reshape(-1, 3), *(placed(run, body, 0)[0] for body in flexible)])
    low, high = shown.min(axis=0), shown.max(axis=0)
    size = float(np.linalg.norm(high - low)) or LONE
    balls = _balls(run, told, JOINT_SHARE * size)
    solids = _solids(run, told.get("body", {}), bundles)
    rigid = _rigid(run, solids, balls, _spherical_frames(told), size)
    pins = _pins(run, told, bundles, PIN_SHARE * size)
    return Mechanism(run, rigid, flexible, balls, pins, view(run, told, direction), 0.5 * (low + high), size)


def pose(run: xr.Dataset, index: int, step: int) -> np.ndarray:
    """Homogeneous matrix of a body, from axes through its centre of mass to the world."""
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_matrix(run.quaternion.values[step, index])
    matrix[:3, 3] = run.position.values[step, index]
    return matrix


def placed(run: xr.Dataset, body: Flexible, step: int) -> tuple[np.ndarray, np.ndarray]:
    """World points of the exaggerated surface, shape (point, 3), and their true displacement [m], (point,)."""
    q = run.modal_coordinate.values[step, body.columns]
    points, size = surface(body.bundle, q, body.scale)
    mass = float(body.bundle.mass)
    # the run's position is the centre of mass; the bundle's origin is elsewhere
    centre = (body.bundle.first_moment.values + body.bundle.modal_first_moment.values @ q) / mass
    matrix = pose(run, body.index, step)
    return (points - centre) @ matrix[:3, :3].T + matrix[:3, 3], size / body.scale


def _names(run: xr.Dataset, dim: str) -> list[str]:
    """Names along a dimension; none where the run has no such parts."""
    return [str(name) for name in run[dim].values] if dim in run.coords else []


def _solids(run: xr.Dataset, told: Mapping[str, Any], bundles: Mapping[str, xr.Dataset]) -> dict[str, Solid | None]:
    found: dict[str, Solid | None] = {}
    for name in _names(run, "body"):
        if name not in bundles:
            body = told.get(name, {})
            found[name] = equivalent(body["mass"], np.array(body["inertia"])) if "inertia" in body else None
    return found


def _rigid(
    run: xr.Dataset, solids: Mapping[str, Solid | None], balls: tuple[Ball, ...], sockets: set[str], size: float
) -> tuple[Rigid, ...]:
    """Rigid bodies; one whose centre of mass lies inside its joint's ball is drawn by that ball and its arms.

    The equivalent solid of a body is drawn where it can be the body itself: where it is no larger than what its
    frames span. Else a link between the frames is.
    """
    arm = ARM_SHARE * size
    names, known = _names(run, "body"), _names(run, "frame")
    radius = {known[ball.frame]: ball.radius for ball in balls}
    kinds: dict[tuple[float, ...], str] = {}
    result = []
    for name, given in solids.items():
        frames = _frames(run, names.index(name), name)
        inside = any(np.linalg.norm(origin) < radius.get(frame, 0.0) for frame, origin in frames.items())
        solid = None if inside else _plausible(given, frames, size)
        if solid is not None:
            solid = plate(solid, np.array(list(frames.values())).reshape(-1, 3))
        # a slim solid is drawn with slim arms
        width = arm if solid is None else min(arm, float(np.sort(solid.half)[1]))
        holds = solid is not None and any(solid.holds(frames[frame]) for frame in frames if frame in sockets)
        if inside:
            color, opacity = JOINT_COLOR, 1.0
        elif holds and len(frames) <= SOCKET_FRAMES:
            color, opacity = SOCKET_COLOR, 0.4
        else:
            kind = () if solid is None else tuple(np.round(1e3 * solid.half, 1))
            color, opacity = kinds.setdefault(kind, COLORS[len(kinds) % len(COLORS)]), 1.0
        drawn = mesh(solid, frames, width) if solid is not None or inside else link(frames, LINK_SHARE * size)
        result.append(Rigid(names.index(name), drawn, color, opacity))
    return tuple(result)


def _plausible(solid: Solid | None, frames: Mapping[str, np.ndarray], size: float) -> Solid | None:
    """The equivalent solid, made smaller where a body with one place is far larger than the mechanism; None for a link.

    A body whose frames lie apart is a link where its solid reaches beyond them, as the disc does that has the inertia
    of a crank, or where it is slender and lies across them.
    """
    if solid is None:
        return None
    places = np.array(list(frames.values()) or [np.zeros(3)])
    span = float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())
    reach = float(solid.half.max())
    if span <= JOINT_SHARE * size:  # all frames in one place: a block or a disc there
        most = LARGEST_LONE * size
        return solid if reach <= most else Solid(solid.axes, solid.half * most / reach, solid.round)
    along = places[int(np.linalg.norm(places - places[0], axis=1).argmax())] - places[0]
    axis = solid.axes[:, int(solid.half.argmax())]
    slender = reach > SLENDER * float(np.sort(solid.half)[1])
    if slender:
        return solid if abs(axis @ along) > 0.9 * np.linalg.norm(along) and 2.0 * reach < 1.5 * span else None
    flat = float(solid.half.min()) < 0.35 * reach
    # a plate or a platform carries its joints; a disc about one pin of two is the inertia of a link, not its shape
    return solid if flat and len(places) > 2 and 2.0 * reach < 2.2 * span else None


def _pins(
    run: xr.Dataset, told: Mapping[str, Any], bundles: Mapping[str, xr.Dataset], radius: float
) -> tuple[Pin, ...]:
    """A pin at the second frame of each joint that turns about one axis, along z of that frame."""
    bodies, frames, contacts = _names(run, "body"), _names(run, "frame"), _names(run, "contact")
    found = []
    for name, joint in told.get("joint", {}).items():
        frame = joint["between"][1]
        if "revolute" not in joint["type"] or frame not in frames:
            continue
        body = frame.partition(".")[0]
        axis = _axes(told, bundles, frame)[:, 2]
        own = float(joint.get("pin_radius", radius))
        drawn = pv.Cylinder(
            center=(0, 0, 0),
            direction=axis,
            radius=min(max(own, radius), 2.0 * radius),
            height=float(min(max(joint.get("length", 0.0), 3.2 * radius), 4.0 * radius)),
            resolution=40,
        )
        mesh = drawn.triangulate().compute_normals(split_vertices=True, feature_angle=40.0)
        owner = bodies.index(body) if body in bodies else None
        found.append(Pin(frames.index(frame), owner, mesh, contacts.index(name) if name in contacts else None))
    return tuple(found)


def _axes(told: Mapping[str, Any], bundles: Mapping[str, xr.Dataset], frame: str) -> np.ndarray:
    """Axes of a named frame in those of its body, columns, shape (3, 3)."""
    body, _, name = frame.partition(".")
    if body in bundles:
        rotation: np.ndarray = bundles[body]["frame_rotation"].sel(frame=name).values
        return rotation
    pose = told.get("body", {}).get(body, {}).get("frames", {}).get(name, {})
    return quaternion_to_matrix(Pose.model_validate(pose).as_quaternion())


def _frames(run: xr.Dataset, index: int, body: str) -> dict[str, np.ndarray]:
    """Frame origins of a body relative to its centre of mass, body axes, from the first output."""
    matrix = pose(run, index, 0)
    found = {}
    for k, name in enumerate(_names(run, "frame")):
        if name.partition(".")[0] == body:
            found[name] = matrix[:3, :3].T @ (run.frame_position.values[0, k] - matrix[:3, 3])
    return found


def _spherical_frames(told: Mapping[str, Any]) -> set[str]:
    """Frames of all spherical joints, either side."""
    joints = (joint for joint in told.get("joint", {}).values() if "spherical" in joint["type"])
    return {frame for joint in joints for frame in joint["between"]}


def _balls(run: xr.Dataset, told: Mapping[str, Any], radius: float) -> tuple[Ball, ...]:
    """A sphere at the second frame of each spherical joint; `radius` [m] where the scene gives none."""
    frames, contacts = _names(run, "frame"), _names(run, "contact")
    found = []
    for name, joint in told.get("joint", {}).items():
        frame = joint["between"][1]
        if "spherical" in joint["type"] and frame in frames:
            column = contacts.index(name) if name in contacts else None
            found.append(Ball(frames.index(frame), float(joint.get("ball_radius", radius)), column))
    return tuple(found)


def _flexible(run: xr.Dataset, name: str, bundle: xr.Dataset) -> Flexible:
    owners = (
        run.mode_body.values
        if "mode_body" in run.coords
        else np.array([str(m).rpartition(".")[0] for m in run.mode.values])
    )
    columns = np.flatnonzero(owners == name)
    if columns.size != bundle.sizes["mode"] and len(run.mode) == bundle.sizes["mode"]:
        columns = np.arange(bundle.sizes["mode"])
    q = run.modal_coordinate.values[:, columns]
    largest = q[int(np.argmax(np.abs(q).max(axis=1)))]
    scale = max(1.0, float(f"{scale_to(bundle, largest, DEFORMATION_SHARE):.0e}"))
    return Flexible(_names(run, "body").index(name), bundle, columns, scale)
