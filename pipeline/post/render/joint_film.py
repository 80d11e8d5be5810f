"""A film of a joint with clearance: where its ball or pin is, and the force that it feels, slowly around impacts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from matplotlib.layout_engine import ConstrainedLayoutEngine

from flexclear.pipeline.post.overview.figures import centre, orbit
from flexclear.pipeline.post.plotting import style
from flexclear.pipeline.post.render import pace
from flexclear.pipeline.post.single_run.series import derive

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
        right.set(xlim=(time[0], time[-1]), xlabel="time (ms)")
        right.set_title(f"{name}: normal force (N)")
        (trail,) = left.plot([], [], color="#D55E00", lw=1.8, animated=True)
        (dot,) = left.plot([], [], "o", color=style.INK, ms=8, animated=True)
        (mark,) = right.plot([], [], "o", color=style.INK, ms=6, animated=True)
        figure.suptitle(" ", fontsize=12)  # reserves the area of the clock
        clock = figure.text(0.5, 0.965, "", ha="center", va="center", fontsize=12, fontweight="bold", animated=True)
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)
        shown = pace.pace(run, seconds, slower, rate)
        steps = shown.steps(run)
        first = np.searchsorted(time, time[steps] - TRAIL * (time[-1] - time[0]))
        for k, step in enumerate(steps):
            canvas.restore_region(still)
            trail.set_data(x[first[k] : step + 1], y[first[k] : step + 1])
            dot.set_data([x[step]], [y[step]])
            mark.set_data([time[step]], [force[step]])
            clock.set_text(f"t = {time[step]:.2f} ms, {pace.speed_text(float(shown.slower[k]))}")
            for artist in (trail, dot, mark):
                artist.axes.draw_artist(artist)
            figure.draw_artist(clock)
            yield style.pixels(canvas)
