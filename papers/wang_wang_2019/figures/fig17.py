"""Figure 17."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Drawing

from flexclear.papers.wang_wang_2019.figures import Data, Figure
from flexclear.papers.wang_wang_2019.models import CSJ, FAR_CSJ, JOINT, Model, believed_until, references
from flexclear.pipeline.post.plotting import style

PLANES = (("x", "y"), ("x", "z"))


def make(data: Data) -> Drawing:
    """Two projections per model, socket axes, with the clearance circle."""
    models = (CSJ, *FAR_CSJ)
    figure, axes = style.grid(len(PLANES), len(models), (11.6, 6.5), sharex=True, sharey=True)
    for column, model in enumerate(models):
        axes[0, column].set_title(model.label.replace(" modes", ""), fontsize=8.6)
        for row, plane in enumerate(PLANES):
            _projection(axes[row, column], plane, model, data)
    for row, plane in enumerate(PLANES):
        axes[row, 0].set_ylabel(f"{plane[1]} in the socket (mm)")
    for column in range(len(models)):
        axes[-1, column].set_xlabel("x in the socket (mm)")
    style.heading(
        figure,
        "Figure 17: the ball flies from wall to wall; with a flexible rod its ways part from run to run",
        "centre of the ball in the socket; grey: clearance sphere; pale: beyond the horizon; dots: where impacts "
        "begin before it",
    )
    return figure


def _projection(axes: style.Axes, plane: tuple[str, str], model: Model, data: dict[str, xr.Dataset]) -> None:
    run, post = data[f"{model.scene}:run"], data[f"{model.scene}:post"]
    offset = 1e3 * run.contact_offset.sel(contact=JOINT)
    x, y = (offset.sel(axis=name).values for name in plane)
    time, horizon = run.time.values, believed_until(post)
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    radius = 1e3 * float(post.clearance.sel(contact=JOINT))
    axes.fill(radius * np.cos(turn), radius * np.sin(turn), color="#f3f3f3", zorder=0)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color="#a8a8a8", lw=1.0, zorder=1)
    inside = time <= horizon
    axes.plot(x, y, color=model.color, lw=0.5, alpha=0.35)
    axes.plot(x[inside], y[inside], color=model.color, lw=0.8)
    index = np.searchsorted(time, post.impact_time.values - 1e-9) if "impact_time" in post else np.empty(0, int)
    index = index[index < time.size]
    index = index[time[index] <= horizon]
    axes.plot(x[index], y[index], "o", ms=2.6, color=style.INK)
    axes.set_aspect("equal")


FIGURE = Figure(
    "Figure 17: trajectory of the ball's centre in the socket, CSJ and FAR-CSJ models",
    references((CSJ, *FAR_CSJ), "run", "post"),
    make,
)
