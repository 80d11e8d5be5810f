"""The figures of the atlas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.family import FINISHED, REFUSED, WRONG, Record
from benchmarks.page import png
from benchmarks.stability.runs import LEDGER
from benchmarks.stability.scenes import ALONG, RANGES, Parameters
from flexclear.pipeline.core.scene.integrators import DEFAULT, INTEGRATORS
from flexclear.pipeline.post.plotting.style import SOFT, plt, style

BLUE, MARKS = "#0072B2", {REFUSED: ("D", "#E69F00"), WRONG: ("X", "#D55E00")}
LOGARITHMIC = {"clearance", "stiffness", "speed", "mass", "strokes", "nearness"}
LABELS = {
    "clearance": "clearance [m]",
    "stiffness": "contact stiffness / the paper's",
    "restitution": "restitution asked for",
    "friction": "static friction coefficient",
    "speed": "speed / the paper's",
    "mass": "platform mass / the paper's",
    "modes": "elastic coordinates of rod 1",
    "damping": "modal damping ratio (13 modes)",
    "nearness": "distance to the singular geometry",
    "joints": "clearance joints",
    "strokes": "strokes",
}
#: planes in which the random points are shown
PLANES = (("clearance", "stiffness"), ("speed", "mass"), ("restitution", "friction"), ("nearness", "joints"))
#: symbols by the integrator that made the run
SYMBOLS = {
    DEFAULT: ("o", "as asked for"),
    INTEGRATORS[DEFAULT].hands_over_to: ("s", "an implicit method took over"),
}


@dataclass(frozen=True)
class Shade:
    """What colours the random points: a number of a record, and the decades of its colour bar."""

    label: str
    number: str
    ticks: tuple[float, ...]


SHADES = (
    Shade("energy error", "ledger", (-14.0, -12.0, -10.0, -8.0, -6.0, -4.0)),
    Shade("evaluations", "evaluations", (4.0, 5.0, 6.0, 7.0)),
)


def files(records: Sequence[Record]) -> dict[str, bytes]:
    """All figures, by path below docs/."""
    random = [r for r in records if r["sweep"] == "random"]
    with style():
        return {
            "stability/sweeps.png": _sweeps(records, "evaluations", "evaluations"),
            "stability/ledger.png": _sweeps(records, "ledger", "energy error", limit=LEDGER),
            "stability/horizon.png": _sweeps(records, "horizon_share", "share before the horizon", logarithmic=False),
            "stability/random.png": _random(random),
        }


def _axis(row: Record, name: str) -> float:
    """Where a record lies on the axis of a parameter."""
    value = float(row["parameters"][name])
    return 1.0 - value if name == "nearness" else value


def _sweeps(
    rows: Sequence[Record], number: str, label: str, *, logarithmic: bool = True, limit: float | None = None
) -> bytes:
    """A panel per parameter, all with one vertical axis."""
    columns = 4
    lines = -(-len(RANGES) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(12.5, 2.5 * lines), sharey=True, squeeze=False)
    finished = [r[number] for r in rows if r["verdict"] == FINISHED and r["sweep"] in RANGES]
    floor = 0.5 * min(finished, default=1.0) if logarithmic else 0.0
    for k, (ax, sweep) in enumerate(zip(axes.ravel(), RANGES, strict=False)):
        if logarithmic:
            ax.set_yscale("log")
        _panel(ax, [row for row in rows if row["sweep"] == sweep], sweep, number, floor)
        if not logarithmic:
            ax.set_ylim(0.0, 1.05)
        if limit is not None:
            ax.axhline(limit, color=MARKS[WRONG][1], linewidth=0.8, linestyle=":")
        if k % columns == 0:
            ax.set_ylabel(label)
    for ax in axes.ravel()[len(RANGES) :]:
        ax.set_visible(False)
    return png(figure)


def _panel(ax: Any, rows: Sequence[Record], sweep: str, number: str, floor: float) -> None:
    if sweep in LOGARITHMIC:
        ax.set_xscale("log")
    done = [row for row in rows if row["verdict"] == FINISHED]
    places, heights = [_axis(row, sweep) for row in done], [row[number] for row in done]
    ax.plot(places, heights, "o-", color=BLUE, markersize=4, linewidth=1)
    for verdict, (mark, color) in MARKS.items():
        lost = [_axis(row, sweep) for row in rows if row["verdict"] == verdict]
        if lost:
            ax.plot(lost, [floor] * len(lost), mark, color=color, markersize=7, clip_on=False)
    switched = [k for k, row in enumerate(done) if row["switched"]]
    if switched:
        ring = {"color": "none", "markeredgecolor": SOFT, "markersize": 9}
        ax.plot([places[k] for k in switched], [heights[k] for k in switched], "o", **ring)
    if sweep == "nearness":
        ax.invert_xaxis()
    if sweep not in ALONG:
        paper = float(getattr(Parameters(), sweep))
        ax.axvline(1.0 - paper if sweep == "nearness" else paper, color=SOFT, linewidth=0.8, linestyle=":")
    ax.set_title(LABELS[sweep], fontsize=8.5)


def _random(rows: Sequence[Record]) -> bytes:
    """The random points in planes of two parameters each, coloured by their energy errors and by their cost."""
    figure, axes = plt.subplots(2, len(PLANES), figsize=(12.5, 6.2))
    for line, shade in zip(axes, SHADES, strict=True):
        shown: Any = None
        for ax, (x, y) in zip(line, PLANES, strict=True):
            shown = _points(ax, rows, x, y, shade) or shown
        bar = figure.colorbar(shown, ax=line, label=shade.label, aspect=16)
        bar.set_ticks(shade.ticks, labels=[f"$10^{{{t:.0f}}}$" for t in shade.ticks])
    _legend(figure)
    return png(figure)


def _points(ax: Any, rows: Sequence[Record], x: str, y: str, shade: Shade) -> Any:
    """One plane of the random points; returns what a colour bar needs."""
    shown: Any = None
    for method, (symbol, _) in SYMBOLS.items():
        done = [row for row in rows if row["verdict"] == FINISHED and row["method"] == method]
        shown = ax.scatter(
            [_axis(row, x) for row in done],
            [_shaken(row, y) for row in done],
            c=[np.log10(max(row[shade.number], 1e-16)) for row in done],
            marker=symbol,
            cmap="viridis",
            vmin=shade.ticks[0],
            vmax=shade.ticks[-1],
            s=22,
            linewidths=0,
        )
    for verdict, (mark, color) in MARKS.items():
        lost = [row for row in rows if row["verdict"] == verdict]
        ax.scatter([_axis(r, x) for r in lost], [_shaken(r, y) for r in lost], marker=mark, color=color, s=42)
    _name_axes(ax, x, y)
    return shown


def _shaken(row: Record, name: str) -> float:
    """Whole numbers spread a little, so that points do not hide each other; the same for the same case."""
    value = _axis(row, name)
    return value + 0.6 * (row["parameters"]["restitution"] - 0.5) if name == "joints" else value


def _name_axes(ax: Any, x: str, y: str) -> None:
    ax.set_xlabel(LABELS[x])
    ax.set_ylabel(LABELS[y])
    if x in LOGARITHMIC:
        ax.set_xscale("log")
    if y in LOGARITHMIC:
        ax.set_yscale("log")
    if x == "nearness":
        ax.invert_xaxis()


def _legend(figure: Any) -> None:
    """Symbols of methods and verdicts."""
    entries = [("o", SOFT, text) if s == "o" else (s, SOFT, text) for s, text in SYMBOLS.values()]
    entries += [(mark, color, verdict) for verdict, (mark, color) in MARKS.items()]
    handles = [
        plt.Line2D([], [], marker=mark, color=color, linestyle="", markersize=6, label=text)
        for mark, color, text in entries
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
