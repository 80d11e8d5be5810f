"""A run as moving solids: its bodies, joints and rods, and their poses at one output."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.post import body_shape
from flexclear.post.body_shape import faces, scale_to, surface
from flexclear.post.render import forms, surfaces
from flexclear.post.render.forms import Seat, Solid, Wheel, equivalent_solid, wheels
from flexclear.post.render.layout import (
    CLEARANCE_COLOR,
    GROUND_COLOR,
    JOINT_COLOR,
    PIN,
    SOCKET_COLOR,
    Layout,
    Part,
    centre_at_rest,
    loads,
    names,
    part_pose,
    pose,
    samples,
    travel_range,
)
from flexclear.post.render.surfaces import Surface
from flexclear.post.render.view import View, view
from flexclear.post.single_run.series import parameters
from flexclear.scene.loose_joints import SURFACES
from flexclear.system.errors import InputError

#: one colour per kind of body: bodies of equal mass and inertia look alike
COLORS = ("#5b7fa6", "#c9a66b", "#8a9a5b", "#7d6b91", "#6fa8a0", "#a0736b", "#9aa5b1")
#: fractions of the mechanism's size: joint spheres without a known ball radius, thickness of rails
BALL, RAIL = 0.022, 0.008
#: radius of a drawn socket over that of its ball or pin: the clearance is drawn as if it were the difference
SOCKET = 1.3
_CORNERS = np.array([[k & 1, k & 2, k & 4] for k in range(8)], dtype=bool)
#: largest drawn deformation as a fraction of the body's length
DEFORMATION_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class Flexible:
    """A flexible body: its bundle, index in the run, columns of its modal coordinates, drawn exaggeration, colour.

    stressed: True when its colours show von Mises stress instead of displacement.
    """

    index: int
    bundle: xr.Dataset
    columns: np.ndarray
    scale: float
    color: str | None = None
    stressed: bool = False


@dataclass(frozen=True, slots=True)
class Looks:
    """Settings of a scene for its pictures.

    bodies: `geometry` and `color` by body.  folder: base of relative paths of shape files.  The rest as of `[view]`.
    """

    bodies: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    folder: Path = Path(".")
    direction: Sequence[float] | None = None
    up: Sequence[float] | None = None
    zoom: float = 1.0
    exaggeration: float | None = None
    duration: float | None = None
    impact_slowdown: float | None = None


@dataclass(frozen=True, slots=True)
class Mechanism:
    """The drawn mechanism of one run."""

    run: xr.Dataset
    parts: tuple[Part, ...]
    flexible: tuple[Flexible, ...]
    view: View
    size: float  #: diagonal of the box of all frames and of the flexible bodies at the start [m]
    cloud: np.ndarray  #: points that span everything drawn over the run, world axes [m], shape (n, 3)
    looks: Looks
    stress: float | None = None  #: stress at the upper end of the colours [Pa], where they show stress


def mechanism(
    run: xr.Dataset, bundles: Mapping[str, xr.Dataset], looks: Looks | None = None, *, stressed: bool = False
) -> Mechanism:
    """Return the drawn mechanism of a run; bundles by name of the flexible body.

    stressed: True colours flexible bodies by von Mises stress.  InputError for a run that records none.
    """
    looks = looks or Looks()
    at = Layout(run, shown_parts(parameters(run), looks), bundles)
    if stressed and not body_shape.bodies_with_stress(run):
        problem = "the run records no von Mises stress"
        raise InputError(
            "--what stress", problem, 'request it: [output] stress = ["BODY"], a rod of known section or a solid'
        )
    flexible = tuple(
        _flexible_body(run, name, bundle, looks, stressed=stressed)
        for name, bundle in bundles.items()
        if name in at.bodies
    )
    positions = run.frame_position.values if at.frames else run.position.values
    shown = np.concatenate([positions.reshape(-1, 3), *(drawn_points(run, body, 0)[0] for body in flexible)])
    # 1.0: size of a mechanism without extent: one body that rests [m]
    size = float(np.linalg.norm(np.ptp(shown, axis=0))) or 1.0
    bodies = tuple(_bodies(at, looks, size))
    parts = (*bodies, *_joints(at, size), *loads(at, size, bodies))
    chosen_view = view(run, at.given, looks.direction, looks.up)
    top = max(body_shape.largest_stress(run), 1e-9) if stressed else None
    shown = cloud(run, parts, flexible, samples(run))
    return Mechanism(run, parts, flexible, chosen_view, size, shown, looks, top)


def shown_parts(text: Mapping[str, Any], looks: Looks) -> dict[str, Any]:
    """Return the parts of a scene without bodies of no shape that carry nothing, and without what acts on them."""
    sides = [{frame.partition(".")[0] for frame in one["between"]} for one in text.get("joint", {}).values()]
    unshaped = {name for name, look in looks.bodies.items() if not look.get("geometry", True)}
    without = {name for name in unshaped if sum(name in both for both in sides) == 1}
    bearings = {name for name, both in zip(text.get("joint", ()), sides, strict=True) if not without.isdisjoint(both)}

    def drawn(name: str, part: Any) -> bool:
        ends = [*part.get("between", ()), *(str(part.get(key, "")) for key in ("joint", "first", "second", "frame"))]
        return name not in without and (without | bearings).isdisjoint(end.partition(".")[0] for end in ends)

    families = {"body", "joint", "drive", "load", "stop", "gear"} if without else set()
    return {key: {n: p for n, p in one.items() if drawn(n, p)} if key in families else one for key, one in text.items()}


def cloud(run: xr.Dataset, parts: Sequence[Part], flexible: Sequence[Flexible], steps: Sequence[int]) -> np.ndarray:
    """Return corners of the boxes of all parts, and points of flexible bodies, at these outputs of the run."""
    clouds = []
    for step in steps:
        for part in parts:
            low, high = part.surface.points.min(axis=0), part.surface.points.max(axis=0)
            corners = np.where(_CORNERS, high, low)
            matrix = part_pose(run, part, step)
            clouds.append(corners @ matrix[:3, :3].T + matrix[:3, 3])
        clouds += [drawn_points(run, body, step)[0][::7] for body in flexible]
    return np.concatenate(clouds) if clouds else run.position.values[0]


def drawn_points(run: xr.Dataset, body: Flexible, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return world points of the exaggerated surface, shape (point, 3), and their true displacement [m], (point,)."""
    q, known = run.variables["modal_coordinate"].values[step, body.columns], body.bundle.variables
    points, size = surface(body.bundle, q, body.scale)
    matrix = pose(run, body.index, step)
    moment = known["first_moment"].values + known["modal_first_moment"].values @ q
    return (points - moment / float(known["mass"].values)) @ matrix[:3, :3].T + matrix[:3, 3], size / body.scale


def shaded_points(run: xr.Dataset, body: Flexible, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of `drawn_points`, and what colours them: von Mises stress [Pa], or displacement [m]."""
    points, displacement = drawn_points(run, body, step)
    if not body.stressed:
        return points, displacement
    return points, body_shape.stress_on_surface(run, body.bundle, names(run, "body")[body.index], step)


def skin(bundle: xr.Dataset, points: np.ndarray, *, sharp: bool = False) -> Surface:
    """Return the surface of a flexible body at points as of `drawn_points` or `points_at_rest`; empty for bare nodes.

    Unless `sharp`, points keep their number, so that fields fit; edges of solids are then shaded softly.
    """
    return surfaces.with_normals(points, surfaces.triangulate(faces(bundle)), sharp=sharp)


def points_at_rest(bundle: xr.Dataset) -> np.ndarray:
    """Return points of the skin of an undeformed body, its centre of mass at the origin [m], shape (point, 3)."""
    return surface(bundle, np.zeros(bundle.sizes["mode"]))[0] - centre_at_rest(bundle)


def _seats(at: Layout) -> dict[str, list[Seat]]:
    """Return the frames on each body: those of joints, then those of loads, then all others."""
    sites = [(joint["type"], joint["between"]) for joint in at.given.get("joint", {}).values()]
    sites += [(forms.LOADED, load.get("between", [load.get("frame")])) for load in at.given.get("load", {}).values()]
    bodies = at.given.get("body", {}).items()
    sites += [(forms.BARE, [f"{name}.{frame}" for frame in body.get("frames", ())]) for name, body in bodies]
    by_body: dict[str, list[Seat]] = {}
    for kind, frames in sites:
        for k, frame in enumerate(filter(None, frames)):
            seat = Seat(frame, *at.frame_in_body(frame), kind, k == 0)
            by_body.setdefault(frame.partition(".")[0], []).append(seat)
    return by_body


def _bodies(at: Layout, looks: Looks, size: float) -> Iterator[Part]:
    """Yield rigid bodies and the ground, as their scene draws them or as links between their joints."""
    kinds: dict[tuple[Any, ...], str] = {}
    seats, geared = _seats(at), wheels(at.given, at.at_start)
    for name, body in at.given.get("body", {}).items():
        look = looks.bodies.get(name, {})
        own = None if "geometry" not in look else forms.shapes(look["geometry"], looks.folder)
        owner = at.owner(name)
        if owner is None:
            if own is not None:
                yield Part(None, own, look.get("color", GROUND_COLOR))
        elif name in at.bundles:
            if own is not None:  # shapes fixed to the deformed mesh
                yield Part(owner, surfaces.place(own, -at.centre(name)), look.get("color", COLORS[0]))
        elif "inertia" in body:
            com, inertia = at.centre(name), np.array(body["inertia"])
            key = tuple(f"{value:.3g}" for value in (body["mass"], *np.linalg.eigvalsh(inertia)))
            key = (rod_of(name, body),) if "segment" in body else key
            color = look.get("color") or kinds.setdefault(key, COLORS[len(kinds) % len(COLORS)])
            solid = equivalent_solid(body["mass"], inertia) if np.any(inertia) and body["mass"] else None
            drawn = own or _with_wheels(geared.get(name, ()), seats.get(name, []), com, solid, size, owner)
            if len(drawn.points):
                yield Part(owner, surfaces.place(drawn, -com), color)


def rod_of(name: str, body: Mapping[str, Any]) -> str:
    """Return the name of the rod of which a body is a segment; its own name for a whole body."""
    return name.removesuffix(f"_{body['segment'][0]}") if "segment" in body else name


def _with_wheels(
    geared: Sequence[Wheel], seats: Sequence[Seat], com: np.ndarray, solid: Solid | None, size: float, layer: int
) -> Surface:
    """Return a body between its joints, with the wheels of its gears."""
    discs = [
        forms.wheel_of_gear(
            next(seat for seat in seats if seat.frame == wheel.frame), wheel.radius, size, inner=wheel.inner
        )
        for wheel in geared
    ]
    if discs and all(np.linalg.norm(seat.origin - seats[0].origin) < 1e-9 for seat in seats):
        return surfaces.join(discs)  # the body is the wheel
    return surfaces.join([*discs, forms.link(seats, com, solid, size, layer)])


def _joints(at: Layout, size: float) -> Iterator[Part]:
    """Yield balls, pins, rails, crosses and planes of the joints."""
    contacts = names(at.run, "contact")
    for name, joint in at.given.get("joint", {}).items():
        kind, (first, second) = joint["type"], joint["between"]
        own = [k for k, one in enumerate(contacts) if kind in SURFACES and one.partition(".")[0] == name]
        contact = own[0] if own else None
        color = JOINT_COLOR if contact is None else CLEARANCE_COLOR
        grounded = at.owner(first) is None
        if kind in forms.BALLS:
            radius = float(joint.get("ball_radius", BALL * size))
            yield at.part_at_frame(second, surfaces.sphere(radius), color, contact)
            if kind in SURFACES and not SURFACES[kind].hollow:
                yield at.part_at_frame(first, _floor(at, joint, size), GROUND_COLOR)
            else:
                yield at.part_at_frame(first, surfaces.sphere(SOCKET * radius), SOCKET_COLOR, opacity=0.35)
        elif "revolute" in kind or "slot" in kind or kind == "clearance-cylindrical":
            radius = float(joint.get("pin_radius", PIN * size))
            long = max(3.4 * PIN * size, float(joint.get("length", 0.0)))  # the links would hide shorter ones
            yield at.part_at_frame(second, surfaces.cylinder(radius, long), color, contact)
            if "slot" in kind:
                half = 0.5 * joint.get("travel", 0.0)
                low, high = (-half, half) if half else travel_range(at.run, name)
                rim = surfaces.prism(surfaces.hull(np.array([[low, 0.0], [high, 0.0]]), SOCKET * radius), 0.5 * long)
                yield at.part_at_frame(first, rim, SOCKET_COLOR, opacity=0.5)
            elif kind in SURFACES:
                yield at.part_at_frame(
                    first, surfaces.cylinder(SOCKET * radius, 0.8 * long), SOCKET_COLOR, opacity=0.35
                )
            elif grounded:
                yield at.part_at_frame(first, surfaces.cylinder(1.9 * radius, 2.2 * PIN * size), GROUND_COLOR)
        elif kind == "clearance-prismatic":
            size_of_slider = joint["height"], joint.get("width", joint["height"]), joint["length"]
            yield at.part_at_frame(second, surfaces.box(size_of_slider), color, contact)
            yield at.part_at_frame(first, _guide(at, joint, size_of_slider), SOCKET_COLOR, opacity=0.35)
        elif kind in forms.SLIDING:
            low, high = travel_range(at.run, name)
            rail = surfaces.cylinder(RAIL * size, high - low + 2.0 * PIN * size)
            middle = np.array([0.0, 0.0, 0.5 * (low + high)])
            yield at.part_at_frame(first, surfaces.place(rail, middle), GROUND_COLOR if grounded else JOINT_COLOR)
        elif kind == "universal":
            for frame, axis in ((first, np.eye(3)[0]), (second, np.eye(3)[1])):
                arm = surfaces.cylinder(0.6 * PIN * size, 4.0 * PIN * size)
                yield at.part_at_frame(frame, surfaces.place(arm, np.zeros(3), surfaces.axes_along(axis)), color)
        elif kind == "planar":
            yield at.part_at_frame(second, surfaces.box((4.0 * PIN * size, 4.0 * PIN * size, 0.8 * PIN * size)), color)


def _path(at: Layout, joint: Mapping[str, Any]) -> np.ndarray:
    """Return the places of a joint's second frame in its first, (time, 3); one, its origin, where that moves itself."""
    first, second = joint["between"]
    if at.owner(first) is not None or second not in at.frames:
        return np.zeros((1, 3))
    origin, axes = at.frame_in_body(first)
    return np.asarray((at.run.frame_position.values[:, at.frames.index(second)] - origin) @ axes)


def _guide(at: Layout, joint: Mapping[str, Any], slider: Sequence[float]) -> Surface:
    """Return the faces of a guide, as far as its slider goes or as long as it is."""
    path, (height, width, length) = _path(at, joint)[:, 2], slider
    low, high = path.min() - 0.5 * length, path.max() + 0.5 * length
    if "guide_length" in joint:
        low, high = -0.5 * joint["guide_length"], 0.5 * joint["guide_length"]
    thick, plates = 0.1 * height, list[Surface]()
    for axis, size, gap in ((0, height, joint["clearance"]), (1, width, joint.get("side_clearance", 0.0))):
        across = [width, height][axis] + 2.0 * thick
        box = surfaces.box((thick, across, high - low) if axis == 0 else (across, thick, high - low))
        for side in (1.0, -1.0) if gap else ():
            plates.append(surfaces.place(box, np.eye(3)[axis] * side * (0.5 * (size + thick) + gap)))
    return surfaces.place(surfaces.join(plates), np.array([0.0, 0.0, 0.5 * (low + high)]))


def _floor(at: Layout, joint: Mapping[str, Any], size: float) -> Surface:
    """Return an unlimited plane as far as its ball goes; around the frame's origin where the plane itself moves."""
    first, path = joint["between"][0], _path(at, joint)
    low, high = path.min(axis=0)[:2], path.max(axis=0)[:2]
    reach = 2.5 * float(joint["ball_radius"]) if len(path) > 1 or at.owner(first) is None else 0.25 * size
    plane = surfaces.box((*(high - low + 2.0 * reach), 0.004 * size))
    return surfaces.place(plane, np.array([*(0.5 * (low + high)), -0.002 * size]))


def _flexible_body(run: xr.Dataset, name: str, bundle: xr.Dataset, looks: Looks, *, stressed: bool) -> Flexible:
    columns = np.flatnonzero(run.mode_body.values == name)
    q = run.modal_coordinate.values[:, columns]
    largest = q[int(np.argmax(np.abs(q).max(axis=1)))]
    fitting = max(1.0, float(f"{scale_to(bundle, largest, DEFORMATION_SHARE):.0e}"))
    in_segments = "segment" in parameters(run)["body"][name]  # these fit together only as they are
    scale = 1.0 if in_segments else looks.exaggeration or fitting
    color = looks.bodies.get(name, {}).get("color")
    shown = stressed and name in body_shape.bodies_with_stress(run)
    if stressed:  # grey does not look like a stress
        color = None if shown else GROUND_COLOR
    return Flexible(names(run, "body").index(name), bundle, columns, scale, color, shown)
