"""Plots next to a film, and a film of a joint: drawn once, and then only their moving marks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.layout_engine import ConstrainedLayoutEngine

from flexclear.artifacts import quantities
from flexclear.post.overview.curves import Curve, by_unit, rotation_of_body
from flexclear.post.overview.curves import curves as watched_curves
from flexclear.post.overview.figures import centre, orbit
from flexclear.post.plotting import style
from flexclear.post.render import film_speed, surfaces
from flexclear.post.render.surfaces import Surface
from flexclear.post.render.view import View
from flexclear.post.single_run.series import derive, parameters
from flexclear.scene.loose_joints import SURFACES
from flexclear.scene.quantity import Quantity

#: margin next to titles [pixels]
MARGIN = 6.0
#: size of a picture of a joint [pixels], and length of its trail as a fraction of the run
JOINT_SIZE, TRAIL = (960, 540), 0.02


@dataclass(frozen=True, slots=True)
class Cursor:
    """A moving mark on a curve. begin: first output of the shown part of the curve at each output; None for a dot."""

    artist: Any
    x: np.ndarray
    y: np.ndarray
    begin: np.ndarray | None = None

    def draw(self, step: int) -> None:
        """Draw the mark at one output."""
        shown = slice(step if self.begin is None else self.begin[step], step + 1)
        self.artist.set_data(self.x[shown], self.y[shown])
        self.artist.axes.draw_artist(self.artist)


@dataclass(frozen=True, slots=True)
class Panel:
    """A figure whose static part is stored as pixels, its moving marks, and the clock."""

    canvas: FigureCanvasAgg
    background: Any
    cursors: tuple[Cursor, ...]
    clock: Any
    time: np.ndarray  #: [s]

    def frame(self, step: int, more: str = "", digits: int = 1) -> np.ndarray:
        """Return pixels at one output, shape (height, width, 3); more: text after the time; digits: of the time."""
        self.canvas.restore_region(self.background)
        for cursor in self.cursors:
            cursor.draw(step)
        self.clock.set_text(f"t = {1e3 * self.time[step]:.{digits}f} ms{more}")
        self.canvas.figure.draw_artist(self.clock)
        return style.pixels(self.canvas)


def panel(
    run: xr.Dataset,
    post: xr.Dataset,
    size: tuple[int, int],
    watch: Sequence[str] = (),
    curves: Sequence[Quantity] = (),
) -> Panel:
    """Build the plots of one run: the watched body's motion, a reaction, and a ball or pin in its socket, if any.

    watch: names of bodies, joints and contacts, of which the first of each is shown; else the body that moves farthest,
    the first contact, the first joint.  curves: quantities; the first two that the run has replace motion and reaction.
    """
    loose = [str(run["contact"].values[k]) for k in contacts_with_clearance(run)]
    contact = bool(loose)
    canvas = style.canvas(size, layout=ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.1))
    figure = canvas.figure
    axes = figure.subplots(3 if contact else 2, 1, height_ratios=[1, 1, 1.7] if contact else [1, 1])
    lines = {line.title: line for quantity in curves for line in watched_curves([run], quantity) if line is not None}
    cursors = [_watched_curves(panel, run, line) for panel, line in zip(axes, list(lines.values())[:2], strict=False)]
    if not cursors:
        cursors.append(_motion(axes[0], run, post, _body(run, watch)))
    if len(cursors) < 2:
        cursors.append((_reaction if post.sizes["joint"] else _energy)(axes[1], run, post, watch))
    if contact:
        number = list(run["contact"].values).index(loose[_first_watched(loose, watch) or 0])
        x, y = orbit(axes[2], run, float(post.clearance[number]), number)
        axes[2].set_title(f"{run['contact'].values[number]} {centre(run, number).removeprefix('centre ')}")
        cursors.append(Cursor(_dot(axes[2], 7), x, y))
    titles = [panel.set_title(panel.get_title(loc="left"), loc="left", fontsize=8.2) for panel in axes]
    clock = _clock(canvas, 13, 0.972, style.INK)
    for panel, title in zip(axes, titles, strict=True):
        _fit_title(title, panel, canvas)
    canvas.draw()
    return Panel(canvas, canvas.copy_from_bbox(figure.bbox), tuple(cursors), clock, run.time.values)


def joint_frames(
    run: xr.Dataset, contact: int, seconds: float | None, slower: float | None, rate: int
) -> Iterator[np.ndarray]:
    """Yield pictures of a joint with clearance, its ball or pin and its force, shape (540, 960, 3)."""
    with style.set_style():
        canvas = style.canvas(JOINT_SIZE, layout=ConstrainedLayoutEngine(h_pad=0.12, w_pad=0.12))
        left, right = canvas.figure.subplots(1, 2, width_ratios=[1.1, 1.0])
        name, time = str(run["contact"].values[contact]), run["time"].values
        x, y = orbit(left, run, float(derive(run)["clearance"].values[contact]), contact)
        left.set_title(f"{name}: {centre(run, contact)}")
        right.set_title(f"{name}: normal force (N)")
        (trail,) = left.plot([], [], color="#D55E00", lw=1.8, animated=True)
        begin = np.searchsorted(time, time - TRAIL * (time[-1] - time[0]))
        force = _curve(right, run, run["contact_normal_force"].values[:, contact], "#D55E00", 0.9)
        cursors = Cursor(trail, x, y, begin), Cursor(_dot(left, 8), x, y), force
        clock = _clock(canvas, 12, 0.965, "black")
        plots = Panel(canvas, canvas.copy_from_bbox(canvas.figure.bbox), cursors, clock, time)
        shown = film_speed.frame_times(run, seconds, slower, rate)
        for step, slow in zip(shown.steps(run), shown.slower, strict=True):
            yield plots.frame(int(step), f", {film_speed.speed_text(float(slow))}", 2)


def _clock(canvas: FigureCanvasAgg, fontsize: float, height: float, color: str) -> Any:
    """Return the text that will show the time; the rest of the figure is drawn, with space for that text."""
    canvas.figure.suptitle(" ", fontsize=fontsize)
    look: dict[str, Any] = {"fontsize": fontsize, "fontweight": "bold", "color": color, "animated": True}
    clock = canvas.figure.text(0.5, height, "", ha="center", va="center", **look)
    canvas.draw()
    return clock


def _fit_title(title: Any, axes: style.Axes, canvas: FigureCanvasAgg) -> None:
    """Shift a title that would be cut off at the right to the left; shrink one that is wider than the figure."""
    width, most = title.get_window_extent(canvas.get_renderer()).width, canvas.figure.bbox.width - 2.0 * MARGIN
    if width > most:
        title.set_fontsize(title.get_fontsize() * most / width)
    left = min(axes.bbox.x0, MARGIN + max(most - width, 0.0))
    title.set_x((left - axes.bbox.x0) / axes.bbox.width)


def _first_watched(names: Iterable[object], watch: Sequence[str]) -> int | None:
    """Return the index of the first watched one among names; None where none is watched."""
    known = [str(name) for name in names]
    return next((known.index(name) for name in watch if name in known), None)


def _body(run: xr.Dataset, watch: Sequence[str]) -> int:
    """Return the first watched body; else the one that moves farthest."""
    name = _first_watched(run.body.values, watch)
    if name is not None:
        return name
    distance = np.linalg.norm(run.position.values - run.position.values[:1], axis=-1)
    return int(np.argmax(distance.max(axis=0)))


def _motion(axes: style.Axes, run: xr.Dataset, post: xr.Dataset, body: int) -> Cursor:
    """Draw the rotation of the body, or, without rotation, its displacement along the axis of its largest motion."""
    turned, moved = rotation_of_body(run, str(run.body.values[body])), post.displacement.values[:, body]
    angle = np.degrees(turned.angle)
    # 1e-3: largest angle of a body that does not turn [degrees]
    if np.abs(angle).max() > 1e-3:
        axes.set_title(f"{run.body.values[body]}: {turned.title} (°)")
        return _curve(axes, run, angle, "#0072B2")
    axis = int(np.argmax(np.ptp(moved, axis=0)))
    axes.set_title(f"{run.body.values[body]}: displacement along {'xyz'[axis]} (mm)")
    return _curve(axes, run, 1e3 * moved[:, axis], "#0072B2")


def _reaction(axes: style.Axes, run: xr.Dataset, post: xr.Dataset, watch: Sequence[str]) -> Cursor:
    contacts = [str(name) for name in run.contact.values] if "contact" in run.sizes else []
    joints = [str(name) for name in post.joint.values]
    name = next((name for name in watch if name in contacts or (name in joints and not contacts)), None)
    name = name or (contacts or joints)[0]
    if name not in joints:  # the end of a stop
        unit = quantities.unit(run, Quantity(name, "peak_force"))
        axes.set_title(f"{name}: {'contact force' if unit == 'N' else 'contact torque'} ({unit})")
        return _curve(axes, run, run.contact_normal_force.sel(contact=name).values, "#D55E00", 0.8)
    axes.set_title(f"{name}: {'contact force' if name in contacts else 'reaction'} (N)")
    return _curve(axes, run, post.reaction.sel(joint=name).values, "#D55E00", 0.8)


def _watched_curves(axes: style.Axes, run: xr.Dataset, line: Curve) -> Cursor:
    factor, unit = by_unit({"": line.values}, line.unit)
    axes.set_title(f"{line.title} ({unit})")
    return _curve(axes, run, factor * line.values, "#0072B2", 1.2)


def _energy(axes: style.Axes, run: xr.Dataset, post: xr.Dataset, watch: Sequence[str]) -> Cursor:
    """Draw the kinetic energy instead of a reaction, where the run has no joint."""
    axes.set_title("kinetic energy (J)")
    return _curve(axes, run, run.kinetic.values, "#0072B2")


def _curve(axes: style.Axes, run: xr.Dataset, values: np.ndarray, color: str, width: float = 1.6) -> Cursor:
    time = 1e3 * run.time.values
    axes.plot(time, values, color=color, lw=width)
    axes.set(xlabel="time (ms)", xlim=(time[0], time[-1]))
    axes.locator_params(axis="x", nbins=5)  # else they change with the width that the layout leaves
    style.mark_only_zero(axes)
    return Cursor(_dot(axes, 6), time, values)


def _dot(axes: style.Axes, size: float) -> Any:
    """Return the mark that moves along a curve."""
    (dot,) = axes.plot([], [], "o", color=style.INK, ms=size, animated=True)
    return dot


#: colour of a path, as in the plots of orbits; largest number of its drawn points
PATH_COLOR, PLACES = "#009E73", 1500
#: radius of the mark at the centre and of the path, as fractions of the region's size
MARK, PATH = 0.05, 0.006
#: directions of view of a sphere and of a flat region
SLANTED, ABOVE = np.array([0.5, -1.0, 0.7]), np.array([0.0, -0.45, 1.0])


@dataclass(frozen=True, slots=True)
class JointView:
    """Surfaces in axes of the socket [m]; `mark` about the centre of the ball or pin."""

    room: Surface
    path: Surface
    mark: Surface
    view: View


def contacts_with_clearance(run: xr.Dataset) -> list[int]:
    """Return columns of the contacts that are joints with clearance; ends of stops have no path."""
    joints = parameters(run).get("joint", {})
    return [k for k, name in enumerate(run["contact"].values) if str(name) in joints] if "contact" in run.sizes else []


def drawn_joint(run: xr.Dataset, contact: int) -> JointView:
    """Return the drawn surfaces of one joint with clearance."""
    offset = run["contact_offset"].values[:, contact]
    room, half = _free_region(parameters(run)["joint"][str(run["contact"].values[contact])], offset)
    some = np.unique(np.linspace(0, len(offset) - 1, PLACES).astype(int))
    flat = np.ptp(room.points[:, 2]) < 0.1 * half
    view = View(ABOVE if flat else SLANTED, np.eye(3)[1 if flat else 2], False)
    return JointView(room, surfaces.tube(offset[some], PATH * half), surfaces.sphere(MARK * half), view)


def _free_region(given: dict, offset: np.ndarray) -> tuple[Surface, float]:
    """Return the region of the centre without contact, and a length for the size of marks [m].

    A sphere or disc of the clearance, a slot longer by its travel; for a ball on a plane the plane of the centre at
    contact.
    """
    kind = SURFACES[given["type"]]
    if not kind.hollow:
        low, high = offset.min(axis=0), offset.max(axis=0)
        reach = max(float((high - low).max()), 2.0 * float(given["ball_radius"]))
        plane = surfaces.box((*((high - low)[:2] + 0.4 * reach), 0.005 * reach))
        return surfaces.place(plane, np.array([*(0.5 * (low + high))[:2], given["ball_radius"]])), 0.6 * reach
    clearance = float(given["clearance"])
    if kind.ideal == "spherical":
        return surfaces.sphere(clearance), clearance
    half = 0.5 * float(given.get("travel", 0.0))
    outline = surfaces.hull(np.array([[-half, 0.0], [half, 0.0]]), clearance)
    return surfaces.prism(outline, 0.02 * clearance), max(clearance, 0.3 * half)
