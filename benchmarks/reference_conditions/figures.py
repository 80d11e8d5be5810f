"""Figures of the verdict page, as PNG files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.family import Record as Row
from benchmarks.page import png
from benchmarks.reference_conditions import design
from benchmarks.reference_conditions.claims import Rows, at, far_error
from flexclear.papers.wang_wang_2019.models import FAR_CB, FAR_FIXED, FAR_FREE

#: those of the paper's models where they have such modes, the others from the same palette
COLORS = dict(
    zip(design.CONDITIONS, (FAR_FREE.color, FAR_FIXED.color, "#56B4E9", "#CC79A7", FAR_CB.color), strict=True)
)
MARKERS = dict(zip(design.CONDITIONS, "osDv^", strict=True))
#: shares of error below this are drawn at it
FLOOR = 1e-7


def files(records: Sequence[Row]) -> dict[str, bytes]:
    """Every figure whose rows are there, by path below docs/."""
    found = {}
    for name, (group, draw) in FIGURES.items():
        if rows := [r for r in records if r["case"] == group]:
            found[f"reference-conditions/{name}.png"] = png(draw(rows), dpi=110)
    return found


def _compliance(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(2, 3, figsize=(12, 6.4), sharex=True, sharey=True, layout="constrained")
    for column, place in enumerate(design.PLACES):
        for line, (direction, label) in enumerate((("x", "bending"), ("z", "axial"))):
            ax = axes[line, column]
            for condition in design.CONDITIONS:
                points = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition)]
                count, fraction = ([r[name] for r in points] for name in ("count", direction))
                ax.step(count, fraction, where="post", color=COLORS[condition], label=condition, linewidth=1.6)
            ax.set_title(f"{label}, joint at {place} mm", fontsize=10)
            ax.set_ylim(-0.03, 1.05)
            _plain(ax)
        axes[1, column].set_xlabel("coordinates")
    for ax in axes[:, 0]:
        ax.set_ylabel("share of the compliance")
    axes[0, 0].legend(fontsize=8, loc="center right")
    return figure


def _frequencies(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), sharey=True, layout="constrained")
    for ax, place in zip(axes, design.PLACES, strict=True):
        here = [r for r in rows if r["place_mm"] == place and r["time"] == 0.0]
        full = np.array(next(r for r in here if r["condition"] == design.FULL)["frequency"])
        for condition in design.CONDITIONS:
            found = np.array(next(r for r in here if r["condition"] == condition)["frequency"])
            n = min(len(found), len(full))
            error = np.maximum(np.abs(found[:n] / full[:n] - 1.0), FLOOR)
            ax.semilogy(np.arange(1, n + 1), error, MARKERS[condition] + "-", color=COLORS[condition], label=condition)
        ax.set_title(f"joint at {place} mm", fontsize=10)
        ax.set_xlabel("vibration of the mechanism")
        _plain(ax)
    axes[0].set_ylabel("error of the frequency (share)")
    axes[0].legend(fontsize=8)
    return figure


def _far(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.4), sharey=True, layout="constrained")
    first = next(iter(design.PLACES))
    for condition in design.CONDITIONS:
        of = [r for r in rows if r["condition"] == condition and r["finer"] == 1]
        line = sorted((r for r in of if r["place_mm"] == first), key=lambda r: r["count"])
        style = {"color": COLORS[condition], "marker": MARKERS[condition], "label": condition}
        axes[0].semilogy([r["count"] for r in line], [_off(r, rows) for r in line], **style)
        least = [at(of, place, condition, design.COUNT) for place in design.PLACES]
        axes[1].semilogy(list(design.PLACES), [_off(r, rows) for r in least], **style)
    axes[0].set_xlabel("coordinates (joint at 0 mm)")
    axes[1].set_xlabel("place of the prismatic joint (mm), least whole count from 13")
    axes[1].set_xticks(list(design.PLACES))
    axes[0].set_ylabel("worst error of the largest effects,\nshare of the full rod's")
    axes[0].legend(fontsize=8)
    for ax in axes:
        _plain(ax)
    return figure


def _off(row: Row, rows: list[Row]) -> float:
    return max(FLOOR, far_error(rows, row))


def _clearance(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.4), sharey=True, layout="constrained")
    first = next(iter(design.PLACES))
    for k, condition in enumerate(design.CONDITIONS):
        of = [r for r in rows if r["condition"] == condition]
        least = [at(of, place, condition, design.COUNT) for place in design.PLACES]
        _bars(axes[0], [p + 2.5 * (k - 2) for p in design.PLACES], least, condition)
        line = sorted((r for r in of if r["place_mm"] == first), key=lambda r: r["count"])
        if len(line) > 1:
            _bars(axes[1], [r["count"] + 0.25 * (k - 2) for r in line], line, condition)
    for place in design.PLACES:
        rigid = next(r for r in rows if r["condition"] == design.RIGID and r["place_mm"] == place)["peak_force"]
        axes[0].plot([place - 8, place + 8], [rigid, rigid], color="#888888", label="rigid" if place == first else None)
        best = Rows([], [r for r in rows if r["place_mm"] == place]).best()
        dashed: dict[str, Any] = {"color": "#000000", "linestyle": "--", "linewidth": 1.0}
        words = f"craig-bampton, {best['count']} coordinates" if place == first else None
        axes[0].plot([place - 8, place + 8], [best["peak_force"]] * 2, label=words, **dashed)
    axes[0].set_xticks(list(design.PLACES))
    axes[0].set_xlabel("place of the prismatic joint (mm), least whole count from 13")
    axes[1].set_xlabel("coordinates (joint at 0 mm)")
    axes[1].set_xticks(sorted({*design.RUN_COUNTS, *design.MOST_COMPLETE}))
    axes[0].set_ylabel("peak contact force (N)")
    for ax in axes:
        if ax.get_legend_handles_labels()[0]:
            ax.legend(fontsize=7, loc="center left" if ax is axes[0] else "upper right")
        _plain(ax)
    return figure


def _bars(ax: Any, x: list[float], rows: list[Row], condition: str) -> None:
    mean, spread = ([r[name] for r in rows] for name in ("peak_force", "peak_force_std"))
    style = {"color": COLORS[condition], "marker": MARKERS[condition], "linestyle": "none", "capsize": 3}
    ax.errorbar(x, mean, yerr=spread, label=condition, **style)


def _plain(ax: Any) -> None:
    ax.grid(visible=True, color="#e3e3e3", linewidth=0.7)
    ax.tick_params(labelsize=8)


#: by name: the rows that a figure shows, and who draws it
FIGURES: dict[str, tuple[str, Callable[[list[Row]], Any]]] = {
    "compliance": ("statics", _compliance),
    "frequencies": ("frequencies", _frequencies),
    "far": ("far", _far),
    "clearance": ("clearance", _clearance),
}
