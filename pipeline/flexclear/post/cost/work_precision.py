"""Work-precision diagrams: error against cost for every quantity, with the Pareto front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from flexclear.post.cost.study import MARGIN, is_resolved, median_recording_time, methods
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
    note: str = ""


@dataclass(frozen=True, slots=True)
class Mark:
    """A single point with a name: the paper's own choice, or another program. error: by quantity."""

    name: str
    seconds: float
    error: dict[str, float]


def make(
    name: str, study: xr.Dataset, title: str, marks: tuple[Mark, ...] = (), others: Sequence[Curve] = ()
) -> dict[str, bytes]:
    """Draw ``<name>.png`` and ``.svg``. others: curves of other programs, which take no part in the Pareto front."""
    chosen = [str(q) for q in study["quantity"].values]
    drawn = curves(study)
    recorded = median_recording_time(study)
    with set_style():
        figure, axes = panels(len(chosen), 3, 10.5, 1.1, 2.7)
        for k, ax in enumerate(axes):
            _panel(ax, chosen[k], k, (drawn, others), marks, MARGIN * float(study["reference_uncertainty"].values[k]))
            if np.isfinite(recorded):  # the cost of a run's record, which does not depend on the method
                ax.axvline(recorded, color=SOFT, linewidth=0.9, linestyle=":", zorder=0)
        _legend(figure, drawn, others, marks)
        heading(figure, title, _subtitle(study))
        return files(name, figure)


def curves(study: xr.Dataset) -> list[Curve]:
    """Return the curves of all integrators of a study, those with a tolerance and those with a step."""
    return [
        Curve(
            name, one[f"cpu_seconds_by_{group}"].values, one[f"error_by_{group}"].values, is_resolved(one, group).values
        )
        for group, name, _, one in methods(study)
    ]


def pareto(seconds: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return indices of the points that no other beats in both cost and error, by rising cost; NaN never wins."""
    best, front = np.inf, []
    for k in np.lexsort((error, seconds)):
        if np.isfinite(seconds[k]) and np.isfinite(error[k]) and error[k] < best:
            best = error[k]
            front.append(int(k))
    return np.array(front, dtype=int)


def peers(study: xr.Dataset, tracks: Sequence[Mapping[str, Any]]) -> list[Curve]:
    """Return curves of another program's runs. tracks: name, note, seconds [s] and errors [SI] by quantity."""
    lines = []
    for track in tracks:
        seconds = np.array(track["seconds"], dtype=float)
        error = np.full((len(seconds), study.sizes["quantity"]), np.nan)
        for k, name in enumerate(study["quantity"].values):
            if str(name) in track["error"]:
                error[:, k] = np.array(track["error"][str(name)], dtype=float) / float(study["scale"][k])
        lines.append(Curve(track["name"], seconds, error, np.isfinite(error), track["note"]))
    return lines


def _panel(
    ax: Axes,
    name: str,
    k: int,
    curves_of: tuple[Sequence[Curve], Sequence[Curve]],
    marks: tuple[Mark, ...],
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
    for m in marks:
        if np.isfinite(m.error.get(name, np.nan)):
            ax.plot(m.seconds, m.error[name], "*", color=INK, markersize=9, zorder=5)
            # on the side with more space
            side, shift = ("right", -4) if m.seconds > 0.5 * np.nanmax(seconds) else ("left", 4)
            ax.annotate(
                m.name, (m.seconds, m.error[name]), xytext=(shift, 4), textcoords="offset points", fontsize=6.8, ha=side
            )
    ax.set(xscale="log", yscale=scale_of(ax), title=name)
    set_plain_numbers(ax.xaxis)
    if np.isinf(bound):
        text = "cannot be determined: reference and confirmation\ndiffer in their number of impacts"
        ax.set(yscale="linear", yticks=[])  # no errors to scale
        ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", fontsize=7.5, color=INK)
    elif bound > 0.0:
        ax.axhspan(0.3 * bound, bound, color=GRID, zorder=0)
        ax.set_ylim(bottom=0.3 * bound)
    ax.set(xlabel="CPU time of the integration (s)", ylabel="relative error")


def curve_look(curve: Curve, others: Sequence[Curve]) -> tuple[str, str]:
    """Return colour and mark of a curve; grey ones for other programs."""
    if curve.name in LOOKS:
        return LOOKS[curve.name]
    return SOFT, "xd+*"[list(others).index(curve) % 4] if curve in others else "x"


def _legend(figure: Figure, own: list[Curve], others: Sequence[Curve], marks: tuple[Mark, ...]) -> None:
    handles: list[Artist] = []
    for curve in (*own, *others):
        color, mark = curve_look(curve, others)
        handles.append(Line2D([], [], color=color, marker=mark, label=curve.name))
    handles.append(Line2D([], [], color=INK, linewidth=3.0, alpha=0.18, label="Pareto front"))
    handles.append(Patch(color=GRID, label="cannot be determined"))
    handles.append(Line2D([], [], color=SOFT, linewidth=0.9, linestyle=":", label="recording, the same for all"))
    if marks:
        handles.append(Line2D([], [], color=INK, marker="*", linestyle="none", label="marked single runs"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 4), fontsize=8.4)


def _subtitle(study: xr.Dataset) -> str:
    horizon = study.attrs["horizon"]
    span = "over the whole run" if horizon == "none" else f"up to the horizon, t = {horizon:.4g} s"
    text = f"shaded: less than {MARGIN:g} times the difference between the reference and its confirmation"
    return f"errors {span}, relative to each quantity's size; {text}"
