"""The stability atlas: hard cases of the clearance mechanism, and the outcome of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import atlas
from benchmarks.atlas import ALONG, CLOSURE, DEVIATION, LEDGER, RANGES, Parameters
from benchmarks.family import FINISHED, REFUSED, WRONG, Family, Record
from benchmarks.page import png
from flexclear.post.plotting.style import SOFT, plt, set_style
from flexclear.post.plotting.table import pipe_table
from flexclear.scene.integrators import DEFAULT, INTEGRATORS

TEXT = """{seeds}Parameters and results of every case, to the last digit: [its log](../benchmarks/log/stability.jsonl).

- **{finished} of {total} finished**, {refused} were refused ({fraction:.1f} %), {wrong} finished wrong or failed.
- Largest energy error of a finished run: {ledger:.1e} of the largest energy in its ledger, median {middle:.1e} (more
  than {limit:g} counts as wrong); largest opening of a loop {closure:.1e} m (more than {open:g} counts as wrong).
- {compared} finished runs were repeated at a hundred times tighter tolerance: up to the horizon the platform's
  velocity differs by at most {deviation:.1e} of its largest, median {median:.1e} (more than {far:g} counts as wrong).
- Most expensive case: {evaluations} evaluations, {seconds:.0f} s of processor time; all cases {minutes:.1f} minutes.
- Methods: {methods}.

{reasons}
{table}
"""


def show(records: list[Record]) -> str:
    """Return what finished, what was refused and why, and the worst of each sweep."""
    verdicts = Counter(r["verdict"] for r in records)
    done = [r for r in records if r["verdict"] == FINISHED]
    deviation = np.array([r["deviation"] for r in done if r["deviation"] is not None])
    ledger = np.array([r["ledger"] for r in done])
    seeds = {r["case"].partition(" ")[2].partition("/")[0] for r in records if r["sweep"] == "random"}
    return TEXT.format(
        seeds="".join(f"Seed of the random points: {seed}. " for seed in sorted(seeds)),
        total=len(records),
        finished=verdicts[FINISHED],
        refused=verdicts[REFUSED],
        fraction=100.0 * verdicts[REFUSED] / len(records),
        wrong=verdicts[WRONG],
        ledger=ledger.max(initial=0.0),
        middle=float(np.median(ledger)) if len(ledger) else 0.0,
        limit=LEDGER,
        closure=max((r["closure"] for r in done), default=0.0),
        open=CLOSURE,
        far=DEVIATION,
        compared=len(deviation),
        deviation=deviation.max(initial=0.0),
        median=float(np.median(deviation)) if len(deviation) else 0.0,
        evaluations=max(r.get("evaluations", 0) for r in records),
        seconds=max(r["seconds"] for r in records),
        minutes=sum(r["seconds"] for r in records) / 60.0,
        methods=_methods(done),
        reasons=_reasons(records),
        table=_table(records),
    )


def _methods(done: Sequence[Record]) -> str:
    counted = Counter(f"{r['method']}, which took over" if r["switched"] else r["method"] for r in done)
    return "; ".join(f"{name}: {count}" for name, count in counted.most_common())


def _reasons(records: Sequence[Record]) -> str:
    """Return the first part of the messages of the cases that did not finish; the log has the rest."""
    lines = [
        f"- {r['verdict']} ({r['sweep']}): {' '.join(r['reason'].split()).partition('; ')[0]}\n"
        for r in records
        if r["verdict"] != FINISHED
    ]
    return f"Messages of the cases that did not finish:\n\n{''.join(lines)}" if lines else ""


def _table(records: Sequence[Record]) -> str:
    head = ("sweep", "cases", FINISHED, REFUSED, WRONG, "largest energy error", "largest deviation", "most evaluations")
    rows = []
    for name in dict.fromkeys(r["sweep"] for r in records):
        found = [r for r in records if r["sweep"] == name]
        counts = [str(sum(r["verdict"] == v for r in found)) for v in (FINISHED, REFUSED, WRONG)]
        worst = [_largest([r.get(number) for r in found]) for number in ("ledger", "deviation")]
        rows.append([name, str(len(found)), *counts, *worst, str(max(r.get("evaluations", 0) for r in found))])
    return pipe_table(head, rows)


def _largest(values: Sequence[float | None]) -> str:
    return f"{max(known):.1e}" if (known := [value for value in values if value is not None]) else "-"


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
    """Colouring of the random points: a number of a record, and the decades of the colour bar."""

    label: str
    number: str
    ticks: tuple[float, ...]


SHADES = (
    Shade("energy error", "ledger", (-14.0, -12.0, -10.0, -8.0, -6.0, -4.0)),
    Shade("evaluations", "evaluations", (4.0, 5.0, 6.0, 7.0)),
)


def files(records: Sequence[Record]) -> dict[str, bytes]:
    """Return all figures, by path below docs/."""
    random = [r for r in records if r["sweep"] == "random"]
    with set_style():
        return {
            "stability/sweeps.png": _sweeps(records, "evaluations", "evaluations"),
            "stability/ledger.png": _sweeps(records, "ledger", "energy error", limit=LEDGER),
            "stability/horizon.png": _sweeps(records, "horizon_share", "share before the horizon", logarithmic=False),
            "stability/random.png": _random(random),
        }


def _axis(row: Record, name: str) -> float:
    """Return the position of a record on the axis of a parameter."""
    value = float(row["parameters"][name])
    return 1.0 - value if name == "nearness" else value


def _sweeps(
    rows: Sequence[Record], number: str, label: str, *, logarithmic: bool = True, limit: float | None = None
) -> bytes:
    """Draw one panel per parameter, all with one vertical axis."""
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
    """Draw the random points in planes of two parameters each, coloured by energy error and by cost."""
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
    """Draw one plane of the random points; return the points, which a colour bar needs."""
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
    """Spread whole numbers slightly, so that points do not hide each other; equal cases get equal offsets."""
    value = _axis(row, name)
    return value + 0.6 * (row["parameters"]["restitution"] - 0.5) if name == "joints" else value


def _name_axes(ax: Any, x: str, y: str) -> None:
    ax.set(xlabel=LABELS[x], ylabel=LABELS[y])
    if x in LOGARITHMIC:
        ax.set_xscale("log")
    if y in LOGARITHMIC:
        ax.set_yscale("log")
    if x == "nearness":
        ax.invert_xaxis()


def _legend(figure: Any) -> None:
    """Draw the symbols of methods and verdicts."""
    entries = [("o", SOFT, text) if s == "o" else (s, SOFT, text) for s, text in SYMBOLS.values()]
    entries += [(mark, color, verdict) for verdict, (mark, color) in MARKS.items()]
    handles = [
        plt.Line2D([], [], marker=mark, color=color, linestyle="", markersize=6, label=text)
        for mark, color, text in entries
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


FAMILY = Family(
    what="301 hard cases, and what becomes of each",
    takes="30 min on two cores",
    page="stability.md",
    cases=atlas.cases,
    measure=atlas.measure,
    show=show,
    rows="mass|modes|random",
    files=files,
    settings={"seed": 20190310, "random": 200},
    times=False,
    code=atlas.CODE,
    children=True,
)
