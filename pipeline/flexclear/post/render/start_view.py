"""The start pose of a scene with names: bodies, frames, joints, axes, drives, gravity, clearances and gaps.

The pose is a run of one output (`dynamics.model.start_pose`); nothing here computes a motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from flexclear.post.body_shape import has_edges
from flexclear.post.overview.curves import in_unit
from flexclear.post.plotting import style
from flexclear.post.render import forms, layout, mechanism, player, surfaces
from flexclear.post.render.mechanism import Mechanism
from flexclear.post.render.ruler import exaggeration, project, ruler
from flexclear.post.render.surfaces import Surface
from flexclear.post.render.view import gravity, planar_view
from flexclear.post.single_run.series import parameters
from flexclear.scene.units import quantity

BODY, JOINT, FRAME, DRIVE, LOAD = "#1f2937", "#3b4754", "#6b7280", "#0072B2", layout.LOAD_COLOR
CLEARANCE, GAP = "#a35f00", "#c4161c"
#: fractions of the mechanism's size: half length and thickness of a drawn axis, radius of a drive's arrow, of a gap
AXIS, THIN, ARC, THICK = 0.055, 0.0016, 0.035, 0.004
#: largest angle between parallel axes of joints [-]
PARALLEL = 1e-3


@dataclass(frozen=True, slots=True)
class Mark:
    """A name at a point of the world [m]: text, detail below it, colour."""

    text: str
    detail: str
    point: np.ndarray
    color: str


@dataclass(frozen=True, slots=True)
class Missing:
    """Gap of a joint, as `dynamics.model.start_pose.Gap`: from, to [m], angle [rad]."""

    joint: str
    start: np.ndarray
    end: np.ndarray
    angle: float

    @property
    def words(self) -> str:
        """Distance and angle in words, as in a picture."""
        distance = float(np.linalg.norm(self.end - self.start))
        turned = f"{np.degrees(self.angle):.3g}° off" if self.angle > 1e-7 else ""
        return " and ".join(filter(None, [f"gap {in_unit(distance, 'm')}" if distance > 0.0 else "", turned]))


@dataclass(frozen=True, slots=True)
class StartView:
    """The drawn mechanism, its marks, and sentences below the picture."""

    drawn: mechanism.Mechanism
    marks: tuple[Mark, ...]
    notes: tuple[str, ...]
    gaps: tuple[Missing, ...]
    gravity: np.ndarray  #: sum of the gravity loads, world axes [m/s^2]


def start_view(
    run: xr.Dataset, bundles: Mapping[str, xr.Dataset], gaps: Sequence[Missing], looks: mechanism.Looks | None = None
) -> StartView:
    """Return the view of a start; gaps: of joints that do not fit."""
    drawn = mechanism.mechanism(run, bundles, looks)
    text = mechanism.shown_parts(parameters(run), drawn.looks)
    at = layout.Layout(run, text, bundles)
    # world position of each joint's second frame, and the axes of its first one
    joints = {
        name: (at.at_start(second)[0], at.at_start(first)[1])
        for name, (first, second) in ((name, joint["between"]) for name, joint in text.get("joint", {}).items())
    }
    normal = _normal(text, joints)
    if normal is not None and drawn.looks.direction is None:
        drawn = replace(drawn, view=planar_view(normal, text, drawn.looks.up))
    # translucent, so that red lines inside are visible
    opacity = 0.4 if gaps else 1.0
    rods = [mechanism.rod_of(name, text["body"][name]) for name in run["body"].values.tolist()]
    solid = [
        *(replace(part, opacity=min(part.opacity, opacity)) for part in drawn.parts),
        *(
            _undeformed_body(body, list(dict.fromkeys(rods)).index(rods[body.index]), opacity)
            for body in drawn.flexible
        ),
    ]
    drawn = replace(drawn, parts=tuple(solid), flexible=())
    extra = [layout.Part(None, surface, color) for surface, color in _lines(text, joints, gaps, drawn.size)]
    marked = list(_marks(run, drawn, text, joints, gaps))
    cloud = np.concatenate([drawn.cloud, *(part.surface.points for part in extra), *([m.point] for m in marked)])
    drawn = replace(drawn, parts=(*drawn.parts, *extra), cloud=cloud)
    return StartView(drawn, tuple(marked), tuple(_notes(drawn, text, gaps)), tuple(gaps), gravity(text))


def _undeformed_body(body: mechanism.Flexible, number: int, opacity: float) -> layout.Part:
    """Return a meshed body without deformation; segments of a rod have the same number, which gives the colour."""
    shown = mechanism.skin(body.bundle, mechanism.points_at_rest(body.bundle), sharp=has_edges(body.bundle))
    return layout.Part(body.index, shown, body.color or mechanism.COLORS[number % len(mechanism.COLORS)], opacity)


def page_view(start: StartView) -> dict[str, Any]:
    """Return the pose with its names, for the viewer of a page."""
    labels = [
        {"text": mark.text, "detail": mark.detail, "at": mark.point.tolist(), "color": mark.color}
        for mark in start.marks
    ]
    return player.motion(start.drawn) | {"labels": labels, "state": " · ".join(start.notes)}


def _normal(text: Mapping[str, Any], joints: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> np.ndarray | None:
    """Return the direction about which all joints turn and across which all slide, or None."""
    kinds = {name: joint["type"] for name, joint in text.get("joint", {}).items() if joint["type"] != "fixed"}
    turning = [joints[name][1][:, 2] for name, kind in kinds.items() if kind in forms.TURNING]
    sliding = [joints[name][1][:, 2] for name, kind in kinds.items() if kind == "prismatic"]
    if not turning or len(turning) + len(sliding) < len(kinds):
        return None
    same = all(np.linalg.norm(np.cross(axis, turning[0])) < PARALLEL for axis in turning)
    return turning[0] if same and all(abs(axis @ turning[0]) < PARALLEL for axis in sliding) else None


def _lines(
    text: Mapping[str, Any],
    joints: Mapping[str, tuple[np.ndarray, np.ndarray]],
    gaps: Sequence[Missing],
    size: float,
) -> Iterator[tuple[Surface, str]]:
    """Yield axes of joints, arrows of drives, and gaps."""
    driven = {drive["joint"]: drive for drive in text.get("drive", {}).values() if "joint" in drive}
    for name, (where, axes) in joints.items():
        kind, z = text["joint"][name]["type"], axes[:, 2]
        slides = kind in forms.SLIDING
        if slides or kind in forms.TURNING:
            yield surfaces.bar(where - AXIS * size * z, where + AXIS * size * z, THIN * size), JOINT
        if name in driven and (slides or kind in forms.TURNING):
            turns = not slides or driven[name].get("coordinate") == "rotation"
            yield (_round_arrow if turns else _straight_arrow)(where, axes, size), DRIVE
    for gap in gaps:
        if np.linalg.norm(gap.end - gap.start) > 0.0:
            yield surfaces.bar(gap.start, gap.end, THICK * size), GAP
            yield surfaces.place(surfaces.sphere(2.0 * THICK * size), gap.start), GAP


def _round_arrow(where: np.ndarray, axes: np.ndarray, size: float) -> Surface:
    """Return a round arrow about the axis, in the sense in which the joint's coordinate grows."""
    angle = np.linspace(0.2, 1.5 * np.pi, 40)[:, None]
    ring = where + ARC * size * (np.cos(angle) * axes[:, 0] + np.sin(angle) * axes[:, 1])
    direction = ring[-1] - ring[-2]
    return surfaces.join([surfaces.tube(ring, 1.8 * THIN * size), _head(ring[-1], direction, size)])


def _straight_arrow(where: np.ndarray, axes: np.ndarray, size: float) -> Surface:
    """Return an arrow along the axis, next to it."""
    side = where + 0.5 * ARC * size * axes[:, 0]
    end = side + 1.5 * AXIS * size * axes[:, 2]
    return surfaces.join([surfaces.bar(side, end, 1.8 * THIN * size), _head(end, axes[:, 2], size)])


def _head(base: np.ndarray, direction: np.ndarray, size: float) -> Surface:
    """Return the head of an arrow."""
    return surfaces.cone(base, base + 12.0 * THIN * size * direction / np.linalg.norm(direction), 5.0 * THIN * size)


def _marks(
    run: xr.Dataset,
    drawn: mechanism.Mechanism,
    text: Mapping[str, Any],
    joints: Mapping[str, tuple[np.ndarray, np.ndarray]],
    gaps: Sequence[Missing],
) -> Iterator[Mark]:
    """Yield names, the most important ones first."""
    used, positions = set(), dict(zip(run["frame"].values, run["frame_position"].values[0], strict=True))
    for gap in gaps:
        yield Mark(gap.joint, f"does not fit: {gap.words}", 0.5 * (gap.start + gap.end), GAP)
    bodies = text.get("body", {})
    for name, body in bodies.items():
        segment, count = body.get("segment", (1, 1))
        if body["type"] != "ground" and segment == (count + 1) // 2:  # a rod in segments has one name, at its middle
            index = list(run["body"].values).index(name)
            detail = _body_label(body) if count == 1 else f"flexible, {count} segments"
            yield Mark(mechanism.rod_of(name, body), detail, _middle(run, drawn, index), BODY)
    for name, joint in text.get("joint", {}).items():
        used |= set(joint["between"])
        if all("segment" in bodies[frame.partition(".")[0]] for frame in joint["between"]) and "_cut_" in name:
            continue
        clear = joint.get("clearance")
        clearance = f" {in_unit(clear, 'm')}" if clear else ""
        detail = f"{joint['type']}{clearance}: {' – '.join(_frame(frame, bodies) for frame in joint['between'])}"
        yield Mark(name, detail, joints[name][0], CLEARANCE if clear else JOINT)
    for name, drive in text.get("drive", {}).items():
        if "joint" in drive:
            where = joints[drive["joint"]][0]
            yield Mark(name, f"drives {_coordinate(drive)}: {drive['law']['type']}", where, DRIVE)
        else:
            yield Mark(name, f"drives {drive['frame']}", positions[drive["frame"]], DRIVE)
            used.add(drive["frame"])
    for name, load in text.get("load", {}).items():
        at = load.get("between", [load["frame"]] if "frame" in load else [])
        used |= set(at)
        if at:
            detail = f"{load['type']}: {' – '.join(_frame(frame, bodies) for frame in at)}"
            yield Mark(name, detail, np.mean([positions[f] for f in at], axis=0), LOAD)
        elif "joint" in load:
            yield Mark(name, f"{load['type']}: {_coordinate(load)}", joints[load["joint"]][0], LOAD)
    for name, stop in text.get("stop", {}).items():
        kind = text["joint"][stop["joint"]]["type"]
        yield Mark(name, f"stop of {_coordinate(stop)}: {_range(stop, kind)}", joints[stop["joint"]][0], JOINT)
    for name, gear in text.get("gear", {}).items():
        pair = [gear["first"], gear["second"]]
        where = np.mean([joints[one.partition(".")[0]][0] for one in pair], axis=0)
        yield Mark(name, f"gear {gear['ratio']}: {' – '.join(pair)}", where, JOINT)
    free = {name: where for name, where in positions.items() if name not in used and name.partition(".")[0] in bodies}
    rest = {_frame(name, bodies): where for name, where in free.items()}
    for name, where in rest.items():
        yield Mark(name, "frame", where, FRAME)


def _frame(name: str, bodies: Mapping[str, Any]) -> str:
    """Return the name of a frame, ``rod.tip`` where it is on a segment of ``rod``."""
    body, _, frame = name.partition(".")
    return f"{mechanism.rod_of(body, bodies.get(body, {}))}.{frame}"


def _coordinate(part: Mapping[str, Any]) -> str:
    """Return the joint coordinate on which a part acts, as a scene names it."""
    return ".".join(filter(None, [part["joint"], part.get("coordinate")]))


def _range(stop: Mapping[str, Any], kind: str) -> str:
    """Return the ends of a stop in words; kind: type of its joint."""
    turns = stop.get("coordinate") == "rotation" or kind not in forms.SLIDING
    ends = {end: quantity(stop[end], "angle" if turns else "length") for end in ("lower", "upper") if end in stop}
    return ", ".join(f"{e} {f'{np.degrees(v):.4g}°' if turns else in_unit(v, 'm')}" for e, v in ends.items())


def _body_label(body: Mapping[str, Any]) -> str:
    flexible = "flexible, " if body["type"] == "flexible" else ""
    return f"{flexible}{body['mass']:.4g} kg" if "mass" in body else f"{flexible}body".replace(", body", "")


def _middle(run: xr.Dataset, drawn: mechanism.Mechanism, index: int) -> np.ndarray:
    """Return a point on the drawn shape of a body, close to the middle of that shape."""
    for part in drawn.parts:
        if part.owner == index and part.frame is None and part.contact is None and part.ends is None:
            matrix = layout.pose(run, index, 0)
            low, high = part.surface.points.min(axis=0), part.surface.points.max(axis=0)
            return np.asarray(matrix[:3, :3] @ (0.5 * (low + high)) + matrix[:3, 3])
    return np.asarray(run["position"].values[0, index])


def _notes(drawn: mechanism.Mechanism, parameters: Mapping[str, Any], gaps: Sequence[Missing]) -> Iterator[str]:
    """Yield sentences on facts without a name."""
    yield f"start at t = {parameters.get('time', {}).get('start', 0.0):g} s"
    yield from exaggeration(drawn)
    if not np.any(gravity(parameters)):
        yield "no gravity"
    if gaps:
        yield "red: joints that do not fit"


SIZE, MARGIN = (1600, 1000), 330
#: heights of lines of names [pixels], with details below and without; begin and end of the columns
LINES, TOP, BOTTOM = (33.0, 17.0), 70.0, 90.0


def picture(start: StartView, title: str) -> np.ndarray:
    """Draw the mechanism in the middle, its names in columns left and right; pixels, shape (height, width, 3)."""
    from flexclear.post.render import film

    width, height = SIZE
    canvas = style.canvas(SIZE)
    axes = canvas.figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.imshow(film.still(start.drawn, 0, SIZE, MARGIN), extent=(0, width, height, 0), aspect="auto")
    with style.set_style():
        points = project(start.drawn, np.array([mark.point for mark in start.marks]).reshape(-1, 3), SIZE, MARGIN)
        shown = _columns(axes, start.marks, points)
        write = partial(_write, axes, SIZE[0] - 2 * 20)
        write(20, 26, title, fontsize=13, fontweight="bold", color=style.INK)
        left_out = [] if shown == len(start.marks) else [f"{shown} of {len(start.marks)} names; the page has all"]
        notes = " · ".join([*start.notes, *left_out])
        write(20, 49, notes, fontsize=9.5, color=style.SOFT)
        _draw_directions(axes, start.drawn, start.gravity)
        ruler(axes, start.drawn, SIZE, MARGIN)
    axes.set(xlim=(0, width), ylim=(height, 0))
    canvas.draw()
    return style.pixels(canvas)


def columns(points: np.ndarray, room: int) -> tuple[list[int], list[int]]:
    """Return the names in the left and in the right column, each from top to bottom, at most `room` in a column.

    points: of the names in the picture, shape (n, 2), the most important ones first.
    """
    recorded = list(range(min(len(points), 2 * room)))
    across = sorted(recorded, key=lambda k: (points[k, 0], k))
    half = (len(recorded) + 1) // 2
    middle = 0.5 * SIZE[0]
    # the columns follow the points, unless that would make one of them much longer
    count = int(np.clip(sum(points[k, 0] < middle for k in recorded), len(recorded) - room, room))
    count = count if abs(count - half) <= 0.25 * len(recorded) else half
    sides = across[:count], across[count:]
    return sorted(sides[0], key=lambda k: points[k, 1]), sorted(sides[1], key=lambda k: points[k, 1])


def _columns(axes: style.Axes, marks: Sequence[Mark], points: np.ndarray) -> int:
    """Draw the names and lines to their points, and return the number of drawn names."""
    tall = SIZE[1] - TOP - BOTTOM
    line = LINES[0] if len(marks) <= 2 * int(tall / LINES[0]) else LINES[1]
    sides = columns(points, int(tall / line))
    for side, names in enumerate(sides):
        for y, k in zip(heights(points[names, 1], line, TOP, SIZE[1] - BOTTOM), names, strict=True):
            mark, right = marks[k], bool(side)
            x = SIZE[0] - MARGIN + 12 if right else MARGIN - 12
            align = "left" if right else "right"
            axes.plot([x + (-5 if right else 5), points[k, 0]], [y, points[k, 1]], color=mark.color, lw=0.7, alpha=0.6)
            axes.plot(*points[k], "o", ms=3.5, color=mark.color)
            # 24: twelve pixels beside the mark, and twelve between a text and the picture's edge
            write = partial(_write, axes, MARGIN - 24, x, ha=align)
            write(y, mark.text, fontsize=9.5, fontweight="bold", color=mark.color)
            if line == LINES[0]:
                write(y + 14, mark.detail, fontsize=7.8, color=style.SOFT)
    return sum(map(len, sides))


def _write(axes: style.Axes, room: float, x: float, y: float, text: str, **look: Any) -> None:
    """Write a line of text at a place of the picture, cut at its end to so many pixels."""
    written = axes.text(x, y, text, va="center", parse_math=False, **look)
    while text and (width := written.get_window_extent().width) > room:
        text = text[: min(int(len(text) * room / width), len(text) - 1)]
        written.set_text(f"{text}…")


def heights(requested: np.ndarray, line: float, top: float, bottom: float) -> np.ndarray:
    """Return heights as near to the requested ones (ascending) as lines of this height allow; shape (n,)."""
    result = np.array(requested, dtype=float)
    for k in range(len(result)):
        result[k] = max(result[k], top + 0.5 * line if k == 0 else result[k - 1] + line)
    limit = bottom - 0.5 * line
    for k in reversed(range(len(result))):
        result[k] = min(result[k], limit)
        limit = result[k] - line
    return result


def _draw_directions(axes: style.Axes, drawn: Mechanism, gravity: np.ndarray) -> None:
    """Draw the world's axes and gravity, as projected in the picture."""
    middle = drawn.cloud.mean(axis=0)
    directions = [(np.eye(3)[k], "xyz"[k], style.SOFT) for k in range(3)]
    size = float(np.linalg.norm(gravity))
    if size > 0.0:
        directions.append((gravity / size, f"gravity {size:.4g} m/s²", LOAD))
    for direction, text, color in directions:
        origin = np.array([70.0, SIZE[1] - 75.0]) + (np.array([95.0, -20.0]) if color == LOAD else 0.0)
        ends = project(drawn, np.array([middle, middle + 1e-3 * drawn.size * direction]), SIZE, MARGIN)
        unit = project(drawn, np.array([middle, middle + 1e-3 * drawn.size * drawn.view.up]), SIZE, MARGIN)
        arrow = 46.0 * (ends[1] - ends[0]) / float(np.linalg.norm(unit[1] - unit[0]))
        tip, beyond = origin + arrow, 11.0 / max(float(np.linalg.norm(arrow)), 11.0)
        if np.linalg.norm(arrow) > 4.0:
            head = {"arrowstyle": "-|>", "color": color, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", (tip[0], tip[1]), (origin[0], origin[1]), arrowprops=head)
        else:
            axes.plot(*origin, "o", ms=6, mfc="none", color=color)
        x, y = tip + beyond * arrow
        if color == LOAD:
            axes.text(x + 6.0, y, text, fontsize=9.5, color=color, ha="left", va="center")
        else:
            axes.text(x, y, text, fontsize=9.5, color=color, ha="center", va="center")
