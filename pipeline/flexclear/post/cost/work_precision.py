"""Work-precision diagrams: error against cost for every quantity, with the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from flexclear.post.cost.study import MARGIN, is_resolved, methods
from flexclear.post.plotting.style import (
    GRID,
    INK,
    SOFT,
    files,
    heading,
    panels,
    scale_of,
    set_plain_numbers,
    set_style,
)
from flexclear.scene.integrators import INTEGRATORS

COLOURS = ("#0072B2", "#56B4E9", "#CC79A7", "#E69F00", "#D55E00", "#009E73", "#000000")
MARKS = ("o", "s", "D", "P", "v", "^", "X", "<", ">")
#: one colour and mark per integrator, the same in every figure
LOOKS = {name: (COLOURS[k % len(COLOURS)], MARKS[k % len(MARKS)]) for k, name in enumerate(INTEGRATORS)}


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One integrator over its settings: cost [s], relative errors (setting, quantity), True for measurable ones."""

    name: str
    seconds: np.ndarray
    error: np.ndarray
    resolved: np.ndarray


def make(name: str, study: xr.Dataset, title: str, others: Sequence[Curve] = ()) -> dict[str, bytes]:
    """Draw ``<name>.png`` and ``.svg``, with the scene's own run as a star.

    others: curves of other programs, which take no part in the Pareto front.
    """
    chosen = [str(q) for q in study["quantity"].values]
    drawn = curves(study)
    recorded = float(study["recording_seconds"].median())
    with set_style():
        figure, axes = panels(len(chosen), 3, 10.5, 1.1, 2.7)
        for k, ax in enumerate(axes):
            _panel(ax, chosen[k], k, (drawn, others), MARGIN * float(study["reference_uncertainty"].values[k]))
            if "own_error" in study:
                _star(ax, study.isel(quantity=k))
            if np.isfinite(recorded):  # the cost of a run's record, which does not depend on the method
                ax.axvline(recorded, color=SOFT, linewidth=0.9, linestyle=":", zorder=0)
        _legend(figure, drawn, others)
        heading(figure, title, _subtitle(study))
        return files(name, figure)


def curves(study: xr.Dataset) -> list[Curve]:
    """Return the curves of all integrators of a study, those with a tolerance and those with a step."""
    return [
        Curve(name, one["cpu_seconds"].values, one["error"].values, is_resolved(one).values)
        for name, _, one in methods(study)
    ]


def pareto(seconds: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return indices of the points that no other beats in both cost and error, by rising cost; NaN never wins."""
    best, front = np.inf, []
    for k in np.lexsort((error, seconds)):
        if np.isfinite(seconds[k]) and np.isfinite(error[k]) and error[k] < best:
            best = error[k]
            front.append(int(k))
    return np.array(front, dtype=int)


def _panel(
    ax: Axes,
    name: str,
    k: int,
    curves_of: tuple[Sequence[Curve], Sequence[Curve]],
    bound: float,
) -> None:
    """Draw one quantity. curves_of: ours, and others'. bound: error below which the reference cannot measure."""
    own, others = curves_of
    for curve in (*own, *others):
        color, mark = curve_look(curve, others)
        pick = np.isfinite(curve.error[:, k]) & curve.resolved[:, k]
        ax.plot(curve.seconds[pick], curve.error[pick, k], mark, color=color, linewidth=1.0, markersize=4.5, ls="-")
    seconds = np.concatenate([c.seconds for c in own])
    error = np.concatenate([np.where(c.resolved[:, k], c.error[:, k], np.nan) for c in own])
    front = pareto(seconds, error)
    ax.plot(seconds[front], error[front], color=INK, linewidth=3.0, alpha=0.18, zorder=0)
    ax.set(xscale="log", yscale=scale_of(ax), title=name)
    set_plain_numbers(ax.xaxis)
    if np.isinf(bound):
        text = "cannot be determined: reference and confirmation\ndiffer in their number of impacts"
        ax.set(yscale="linear", yticks=[])  # no errors to scale
        ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", fontsize=7.5, color=INK)
    elif bound > 0.0:
        ax.axhspan(1e-30 * bound, bound, color=GRID, zorder=0)
        ax.set_ylim(bottom=0.3 * bound)
    ax.set(xlabel="CPU time of the integration (s)", ylabel="relative error")


def _star(ax: Axes, study: xr.Dataset) -> None:
    """Mark the scene's own run. study: of one quantity."""
    error = float(study["own_error"]) - float(study["reference_uncertainty"].fillna(0.0))
    if not np.isfinite(error):
        return
    seconds = study.attrs["own_seconds"]
    ax.plot(seconds, error, "*", color=INK, markersize=9, zorder=5)
    if 0.0 < error < ax.get_ylim()[0]:
        ax.set_ylim(bottom=0.3 * error)
    # its name on the side with more space
    side, shift = ("right", -4) if seconds > 0.5 * float(study["cpu_seconds"].max()) else ("left", 4)
    ax.annotate("this scene", (seconds, error), (shift, 4), textcoords="offset points", fontsize=6.8, ha=side)


def curve_look(curve: Curve, others: Sequence[Curve]) -> tuple[str, str]:
    """Return colour and mark of a curve; grey ones for other programs."""
    if curve.name in LOOKS:
        return LOOKS[curve.name]
    return SOFT, "xd+*"[list(others).index(curve) % 4] if curve in others else "x"


def _legend(figure: Figure, own: list[Curve], others: Sequence[Curve]) -> None:
    handles: list[Artist] = []
    for curve in (*own, *others):
        color, mark = curve_look(curve, others)
        handles.append(Line2D([], [], color=color, marker=mark, label=curve.name))
    handles.append(Line2D([], [], color=INK, linewidth=3.0, alpha=0.18, label="Pareto front"))
    handles.append(Patch(color=GRID, label="cannot be determined"))
    handles.append(Line2D([], [], color=SOFT, linewidth=0.9, linestyle=":", label="recording, the same for all"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 4), fontsize=8.4)


def _subtitle(study: xr.Dataset) -> str:
    horizon = study.attrs["horizon"]
    span = "over the whole run" if horizon == "none" else f"up to the horizon, t = {horizon:.4g} s"
    text = f"shaded: less than {MARGIN:g} times the difference between the reference and its confirmation"
    return f"errors {span}, relative to each quantity's size; {text}"
