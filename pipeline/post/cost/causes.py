"""Which cause dominates: the error of the scene as it is, split by what would have to be refined."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from flexclear.pipeline.post.plotting.style import INK, files, grid, heading, style
from flexclear.pipeline.post.plotting.table import Table

#: the causes in the order of the stages that make them, each with what a user would refine
CAUSES = {
    "mesh": "more elements",
    "beam theory": "another theory, or a solid",
    "modal truncation": "more modes, or another mode set",
    "time integration": "a tighter tolerance",
    "event location": "(bounded by the root finder)",
    "sampling of the output": "a shorter output interval",
    "ensemble spread": "more members",
}
#: the message about an error that is infinite
OTHER = "other impacts"
#: letters that fit next to a bar
LETTERS = 52
COLORS = ("#332288", "#88CCEE", "#44AA99", "#DDCC77", "#999933", "#AA4499", "#882255")


def with_causes(study: xr.Dataset, split: Mapping[str, Mapping[str, float]]) -> xr.Dataset:
    """A study's dataset with ``error_by_cause(quantity, cause)``, NaN where a scene has no such cause."""
    names = [str(name) for name in study["quantity"].values]
    values = np.array([[split[name].get(cause, np.nan) for cause in CAUSES] for name in names])
    attributes = {"units": "1", "long_name": "error of the scene as it is, as a fraction of the quantity's size"}
    return study.assign_coords(cause=list(CAUSES)).assign(error_by_cause=(("quantity", "cause"), values, attributes))


def table(split: Mapping[str, Mapping[str, float]], title: str) -> Table:
    """Causes as rows, quantities as columns; '–' where a cause does not exist in the scene."""
    quantities = list(split)
    rows = []
    for cause, remedy in CAUSES.items():
        values = [split[q].get(cause, np.nan) for q in quantities]
        if not np.isnan(values).all():
            rows.append((cause, *(_cell(v) for v in values), remedy))
    largest = ("dominated by", *(dominant(split[q]) for q in quantities), "")
    spread = any(row[0] == "ensemble spread" for row in rows)
    notes = ("The spread of the ensemble is that of the whole run, all other errors are those up to the horizon.",)
    return Table(title, ("cause", *quantities, "to refine"), (*rows, largest), notes if spread else ())


def _cell(error: float) -> str:
    return "–" if np.isnan(error) else "0" if error == 0.0 else f"{error:.1e}" if np.isfinite(error) else OTHER


def dominant(causes: Mapping[str, float]) -> str:
    """The cause with the largest error; one that changes the number of impacts is larger than any other."""
    known = {cause: error for cause, error in causes.items() if not np.isnan(error)}
    return max(known, key=lambda cause: known[cause]) if known else "–"


def make(name: str, split: Mapping[str, Mapping[str, float]], title: str) -> dict[str, bytes]:
    """``<name>.png`` and ``.svg``: per quantity the causes stacked, as fractions of their sum.

    Shares show what to refine; the magnitudes are next to the bars, since causes span many decades.
    """
    with style():
        figure, axes = grid(1, 1, (9.5, 1.6 + 0.55 * len(split)))
        ax = axes[0, 0]
        for row, causes in enumerate(split.values()):
            _bar(ax, row, causes)
        ax.set_yticks(range(len(split)), list(split))
        ax.invert_yaxis()
        ax.set_xlim(0.0, 1.9)
        ax.grid(visible=False, axis="y")
        ax.set_xticks([0.0, 0.5, 1.0], ["0", "50 %", "100 %"])
        ax.set_xlabel("fraction of the sum of all errors", x=0.5 / 1.9)
        ax.spines["bottom"].set_bounds(0.0, 1.0)
        handles, labels = ax.get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=4, fontsize=8.2)
        heading(figure, title, "errors of the scene as it is, relative to each quantity's size, by their cause")
        return files(name, figure)


def _bar(ax: Axes, row: int, causes: Mapping[str, float]) -> None:
    infinite = [cause for cause, e in causes.items() if np.isinf(e)]
    known = dict.fromkeys(infinite, 1.0) or {cause: e for cause, e in causes.items() if e > 0.0}
    total, left = sum(known.values()), 0.0
    for color, cause in zip(COLORS, CAUSES, strict=True):
        if cause in known:
            ax.barh(row, known[cause] / total, left=left, color=color, label=cause, height=0.7)
            left += known[cause] / total
    first = sorted(known, key=lambda cause: -known[cause])[:2]
    text = ", ".join(f"{cause} {known[cause]:.1e}" for cause in first)
    if infinite:
        text = fill(f"{OTHER} by {', '.join(infinite)}", LETTERS)
    ax.text(1.02, row, text or "no error to be seen", va="center", fontsize=7.5, color=INK)
