"""Figures 14-16: the phase plots that the paper calls Poincare maps, and the states at impacts below them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import FixedLocator, FuncFormatter

from flexclear.publishing import style
from papers.comparison import Data, Figure
from papers.wang_wang_2019.models import (
    ACCELERATION,
    ANGLE,
    CSJ,
    DISPLACEMENT,
    FAR_CSJ,
    IDEAL,
    VELOCITY,
    Motion,
    Quantity,
    minus,
    motion,
    references,
)

MODELS = (IDEAL, CSJ, *FAR_CSJ)
#: ticks of an axis that is logarithmic on both sides of zero
SPIKE_TICKS = [sign * size for size in (20.0, 50.0, 100.0, 200.0, 500.0) for sign in (-1.0, 1.0)] + [0.0]


@dataclass(frozen=True, slots=True)
class Plane:
    """The two quantities of a phase plane. One that jumps is linear in the ideal model's range, logarithmic outside.

    heading: title; {x} and {y} in it are the distances from the ideal model's values that impacts cause.
    """

    x: Quantity
    y: Quantity
    heading: str


def _maps(plane: Plane, data: Data) -> Drawing:
    """Draw the phase plots, one per model, and in a second row the same states at the impacts only."""
    motions = [motion(model, data) for model in MODELS]
    figure, axes = style.grid(2, len(MODELS), (13.2, 5.9), sharex=True, sharey="row")
    for column, (model, run) in enumerate(zip(MODELS, motions, strict=True)):
        trajectory(axes[0, column], plane, run)
        short = model.label.replace(" modes", "").replace("Craig-Bampton (added)", "CB (added)")
        axes[0, column].set_title(short, fontsize=8.4)
        at_impacts(axes[1, column], plane, run, motions[0])
        axes[1, column].set_xlabel(plane.x.label)
    _note(axes[1, 0], "no impacts")
    if plane.y.jumps:
        reach = 1.3 * float(np.abs(plane.y.values(motions[0])).max())
        for panel in axes.flat:
            panel.set_yscale("symlog", linthresh=reach, linscale=1.2)
            panel.yaxis.set_major_locator(FixedLocator(SPIKE_TICKS))
            panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            panel.yaxis.set_minor_locator(FixedLocator([]))
            panel.axhspan(-reach, reach, color="#f4f6f8", zorder=0, lw=0)
    axes[0, 0].set_ylabel(f"phase plot\n{plane.y.label}")
    axes[1, 0].set_ylabel(f"section\n{plane.y.label}")
    scale = "; grey band: linear scale, logarithmic outside" if plane.y.jumps else ""
    style.heading(
        figure,
        plane.heading.format(x=f"{off_ideal(plane.x, motions):.1%}", y=f"{off_ideal(plane.y, motions):.0%}"),
        "the paper calls these phase plots Poincaré maps; second row (added): states when an impact begins, hollow "
        f"beyond the horizon{scale}",
    )
    return figure


def off_ideal(quantity: Quantity, motions: Sequence[Motion]) -> float:
    """Return the largest difference of the model with clearance alone from the ideal one, over the latter's maximum."""
    ideal, clear, *_ = motions
    return float(np.abs(minus(clear, ideal, quantity.values)[1]).max() / np.abs(quantity.values(ideal)).max())


def trajectory(axes: Axes, plane: Plane, run: Motion) -> None:
    """Draw the whole trajectory, pale beyond its horizon."""
    inside = run.time <= run.horizon
    x, y = plane.x.values(run), plane.y.values(run)
    axes.plot(x, y, color=run.model.color, lw=0.6, alpha=0.3)
    axes.plot(x[inside], y[inside], color=run.model.color, lw=1.0)


def at_impacts(axes: Axes, plane: Plane, run: Motion, ideal: Motion) -> None:
    """Draw the states at which an impact begins, over the ideal trajectory."""
    axes.plot(plane.x.values(ideal), plane.y.values(ideal), color="#c9c9c9", lw=0.8, zorder=1)
    if run.post.sizes.get("impact", 0) == 0:
        return
    shown = run.time, plane.x.values(run), plane.y.values(run)
    when, x, y = at_times(run.time, run.post.impact_time.values, *shown)
    inside = when <= run.horizon
    axes.scatter(x[inside], y[inside], s=11, color=run.model.color, zorder=3, lw=0)
    axes.scatter(x[~inside], y[~inside], s=11, facecolors="none", edgecolors=run.model.color, lw=0.7, zorder=3)
    _note(axes, f"at {when.size} impacts")


def _note(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=8.0, fontweight="normal", color=style.SOFT)


def at_times(time: np.ndarray, requested: np.ndarray, *values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return each of `values` (first dimension time) at the output times that equal the requested ones.

    Requested times that are no output times (to 1 ns) are left out: nothing is interpolated.
    """
    nearest = np.clip(np.searchsorted(time, requested - 1e-9), 0, time.size - 1)
    index = nearest[np.abs(time[nearest] - requested) <= 1e-9]
    return tuple(value[index] for value in values)


def _figure(title: str, plane: Plane) -> Figure:
    return Figure(title, references(MODELS, "run", "post"), lambda data: _maps(plane, data))


FIG14 = _figure(
    "Figure 14: phase plots of angle and velocity along z, all models",
    Plane(
        ANGLE,
        VELOCITY,
        "Figure 14: impacts take the velocity up to {y} of its largest value off the ideal model's, the angle {x}",
    ),
)
FIG15 = _figure(
    "Figure 15: phase plots of displacement and velocity along z, all models",
    Plane(
        DISPLACEMENT,
        VELOCITY,
        "Figure 15: impacts take the velocity up to {y} of its largest value off the ideal model's, the displacement "
        "{x}",
    ),
)
FIG16 = _figure(
    "Figure 16: phase plots of velocity and acceleration along z, all models",
    Plane(
        VELOCITY,
        ACCELERATION,
        "Figure 16: the acceleration shows every impact; in between the platform moves without leg 1",
    ),
)
