"""A ball or pin in its socket: where its centre may be without contact, and its path; in space, and as a film."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.layout_engine import ConstrainedLayoutEngine

from flexclear.pipeline.post.overview.figures import centre, orbit
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.render import film_speed, surfaces
from flexclear.pipeline.post.render.surfaces import Surface
from flexclear.pipeline.post.render.view import View
from flexclear.pipeline.post.single_run.series import derive, parameters

#: colour of a path, as in the plots of orbits; most points of it that are drawn
PATH_COLOR, PLACES = "#009E73", 1500
#: radius of the mark at the centre and of the path, as fractions of the room's size
MARK, PATH = 0.05, 0.006
#: where a sphere and where a flat room are examined from
SLANTED, ABOVE = np.array([0.5, -1.0, 0.7]), np.array([0.0, -0.45, 1.0])


@dataclass(frozen=True, slots=True)
class JointView:
    """Surfaces in axes of the socket [m]; `mark` about the centre of the ball or pin."""

    room: Surface
    path: Surface
    mark: Surface
    view: View


def with_clearance(run: xr.Dataset) -> list[int]:
    """Columns of the contacts that are joints with clearance; ends of stops have no path."""
    joints = parameters(run).get("joint", {})
    return [k for k, name in enumerate(run["contact"].values) if str(name) in joints] if "contact" in run.sizes else []


def shown(run: xr.Dataset, contact: int) -> JointView:
    """What is drawn of one joint with clearance."""
    offset = run["contact_offset"].values[:, contact]
    room, half = _room(parameters(run)["joint"][str(run["contact"].values[contact])], offset)
    some = np.unique(np.linspace(0, len(offset) - 1, PLACES).astype(int))
    flat = np.ptp(room.points[:, 2]) < 0.1 * half
    seen = View(ABOVE if flat else SLANTED, np.eye(3)[1 if flat else 2], False)
    return JointView(room, surfaces.tube(offset[some], PATH * half), surfaces.sphere(MARK * half), seen)


def _room(given: dict, offset: np.ndarray) -> tuple[Surface, float]:
    """Where the centre may be, and a length that marks are in proportion to [m].

    A sphere or disc of the clearance, a slot longer by its travel; of a ball on a plane the plane in which the centre
    lies when the ball touches.
    """
    if given["type"] == "ball-on-plane":
        low, high = offset.min(axis=0), offset.max(axis=0)
        reach = max(float((high - low).max()), 2.0 * float(given["ball_radius"]))
        plane = surfaces.box((*((high - low)[:2] + 0.4 * reach), 0.005 * reach))
        return surfaces.moved(plane, np.array([*(0.5 * (low + high))[:2], given["ball_radius"]])), 0.6 * reach
    clearance = float(given["clearance"])
    if given["type"] == "clearance-spherical":
        return surfaces.sphere(clearance), clearance
    half = 0.5 * float(given.get("travel", 0.0))
    outline = surfaces.hull(np.array([[-half, 0.0], [half, 0.0]]), clearance)
    return surfaces.prism(outline, 0.02 * clearance), max(clearance, 0.3 * half)


#: size of a picture, and length of the trail as a fraction of the run
SIZE, TRAIL = (960, 540), 0.02


def frames(
    run: xr.Dataset, contact: int, seconds: float | None, slower: float | None, rate: int
) -> Iterator[np.ndarray]:
    """Pictures of shape (540, 960, 3)."""
    with style.style():
        canvas = style.canvas(SIZE, layout=ConstrainedLayoutEngine(h_pad=0.12, w_pad=0.12))
        figure = canvas.figure
        left, right = figure.subplots(1, 2, width_ratios=[1.1, 1.0])
        name = str(run["contact"].values[contact])
        x, y = orbit(left, run, float(derive(run)["clearance"].values[contact]), contact)
        time, force = 1e3 * run["time"].values, run["contact_normal_force"].values[:, contact]
        left.set_title(f"{name}: {centre(run, contact)}")
        right.plot(time, force, color="#D55E00", lw=0.9)
        right.set(xlim=(time[0], time[-1]), xlabel="time (ms)", title=f"{name}: normal force (N)")
        (trail,) = left.plot([], [], color="#D55E00", lw=1.8, animated=True)
        (dot,) = left.plot([], [], "o", color=style.INK, ms=8, animated=True)
        (mark,) = right.plot([], [], "o", color=style.INK, ms=6, animated=True)
        figure.suptitle(" ", fontsize=12)  # reserves the area of the clock
        clock = figure.text(0.5, 0.965, "", ha="center", va="center", fontsize=12, fontweight="bold", animated=True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        shown = film_speed.frame_times(run, seconds, slower, rate)
        steps = shown.steps(run)
        first = np.searchsorted(time, time[steps] - TRAIL * (time[-1] - time[0]))
        for k, step in enumerate(steps):
            canvas.restore_region(still)
            trail.set_data(x[first[k] : step + 1], y[first[k] : step + 1])
            dot.set_data([x[step]], [y[step]])
            mark.set_data([time[step]], [force[step]])
            clock.set_text(f"t = {time[step]:.2f} ms, {film_speed.speed_text(float(shown.slower[k]))}")
            for artist in (trail, dot, mark):
                artist.axes.draw_artist(artist)
            figure.draw_artist(clock)
            yield style.pixels(canvas)
