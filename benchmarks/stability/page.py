"""docs/stability.md from the rows of the atlas: what finished, what was refused and why, figures, the case list."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.stability.cases import RANGES
from benchmarks.stability.run import CLOSURE, FINISHED, LEDGER, REFUSED, WRONG

COLORS = {FINISHED: "#0072B2", REFUSED: "#E69F00", WRONG: "#D55E00"}
LOGARITHMIC = {"clearance", "stiffness", "speed", "mass", "strokes"}
LABELS = {
    "clearance": "clearance (m)",
    "stiffness": "stiffness, times the paper's",
    "restitution": "coefficient of restitution asked for",
    "friction": "static friction coefficient",
    "speed": "speed, times the paper's",
    "mass": "platform mass, times the paper's",
    "modes": "elastic coordinates of rod 1",
    "damping": "modal damping ratio (13 modes)",
    "nearness": "distance to the singular geometry",
    "joints": "clearance joints",
    "strokes": "strokes",
}
TEXT = """# Stability atlas

Made by `{command}`; nothing on this page is typed in. Each case is the 4-SPS/PS mechanism with one parameter moved over
its range, or a random point of all of them (seed {seed}). Parameters and results of every case:
[{table}]({table}).

- **{finished} of {total} finished**, {refused} were refused ({share:.1f} %), {wrong} finished wrong or failed.
- Largest energy error of a finished run: {ledger:.1e} of the largest energy in its ledger (more than {limit:g}
  counts as wrong); largest opening of a loop {closure:.1e} m (more than {open:g} counts as wrong).
- {compared} finished runs were repeated at a hundred times tighter tolerance: up to the horizon the platform's
  position differs by at most {deviation:.1e} clearances (median {median:.1e}).
- Dearest case: {evaluations} evaluations.
- Methods: {methods}.

{reasons}
![What each parameter costs](stability/sweeps.png)

Evaluations over each parameter; the other parameters are the paper's. A diamond is a refusal.

![Energy errors](stability/ledger.png)

Energy error over each parameter, as a share of the largest energy in the run's ledger.

| sweep | cases | finished | refused | wrong | largest energy error | most evaluations |
|---|---:|---:|---:|---:|---:|---:|
{rows}
"""


def write(rows: Sequence[dict[str, Any]], docs: Path, seed: int, command: str) -> None:
    """The page, its figures and the table of all cases, below `docs`."""
    folder = docs / "stability"
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / f"cases_{seed}.csv"
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            [
                {k: _text(v) for k, v in row.items() if k != "seconds"} | {"seconds": f"{row['seconds']:.2f}"}
                for row in rows
            ]
        )
    _figure(rows, "evaluations", "evaluations", folder / "sweeps.png")
    _figure(rows, "ledger", "energy error", folder / "ledger.png")
    (docs / "stability.md").write_text(_page(rows, seed, command, f"stability/{table.name}"))


def _text(value: Any) -> Any:
    return f"{value:.8g}" if isinstance(value, float) else value


def _page(rows: Sequence[dict[str, Any]], seed: int, command: str, table: str) -> str:
    verdicts = Counter(row["verdict"] for row in rows)
    done = [row for row in rows if row["verdict"] == FINISHED]
    deviation = np.array([row["deviation"] for row in done if np.isfinite(row["deviation"])])
    reasons = Counter(_gist(row["reason"]) for row in rows if row["verdict"] != FINISHED)
    told = "".join(f"  - {count} x {reason}\n" for reason, count in reasons.most_common())
    methods = Counter(row["method"] for row in done)
    return TEXT.format(
        command=command,
        seed=seed,
        table=table,
        total=len(rows),
        finished=verdicts[FINISHED],
        refused=verdicts[REFUSED],
        share=100.0 * verdicts[REFUSED] / len(rows),
        wrong=verdicts[WRONG],
        ledger=max(row["ledger"] for row in done),
        limit=LEDGER,
        closure=max(row["closure"] for row in done),
        open=CLOSURE,
        compared=len(deviation),
        deviation=deviation.max(initial=0.0),
        median=float(np.median(deviation)) if len(deviation) else 0.0,
        evaluations=max(row["evaluations"] for row in done),
        methods=", ".join(f"{name} {count}" for name, count in methods.most_common()),
        reasons=f"What did not finish said:\n\n{told}" if told else "",
        rows="\n".join(
            _line(name, [r for r in rows if r["sweep"] == name]) for name in dict.fromkeys(r["sweep"] for r in rows)
        ),
    )


def _gist(reason: str) -> str:
    """A reason without its numbers' values, so that equal ones are counted together."""
    words = reason.splitlines()[0].split(": ", 1)[-1].split()
    return " ".join("..." if any(c.isdigit() for c in word) and not word[0].isalpha() else word for word in words)


def _line(name: str, rows: list[dict[str, Any]]) -> str:
    verdicts = Counter(row["verdict"] for row in rows)
    ledger = max((row["ledger"] for row in rows if np.isfinite(row["ledger"])), default=float("nan"))
    most = max(row["evaluations"] for row in rows)
    counts = " | ".join(str(verdicts[v]) for v in (FINISHED, REFUSED, WRONG))
    return f"| {name} | {len(rows)} | {counts} | {ledger:.1e} | {most} |"


def _figure(rows: Sequence[dict[str, Any]], name: str, label: str, path: Path) -> None:
    columns = 4
    lines = -(-len(RANGES) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(13, 2.6 * lines), squeeze=False, layout="constrained")
    for ax, sweep in zip(axes.ravel(), RANGES, strict=False):
        _panel(ax, [row for row in rows if row["sweep"] == sweep], sweep, name)
        ax.set_ylabel(label)
    for ax in axes.ravel()[len(RANGES) :]:
        ax.set_visible(False)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)


def _panel(ax: Any, rows: list[dict[str, Any]], sweep: str, name: str) -> None:
    value = np.array([1.0 - row[sweep] if sweep == "nearness" else row[sweep] for row in rows], dtype=float)
    height = np.array([row[name] for row in rows], dtype=float)
    done = np.array([row["verdict"] == FINISHED for row in rows])
    ax.plot(value[done], height[done], "o-", color=COLORS[FINISHED], markersize=4, linewidth=1)
    ax.set_yscale("log")
    if sweep in LOGARITHMIC or sweep == "nearness":
        ax.set_xscale("log")
    floor = height[done].min(initial=1.0) if done.any() else 1.0
    for verdict in (REFUSED, WRONG):
        pick = np.array([row["verdict"] == verdict for row in rows])
        ax.plot(value[pick], np.full(pick.sum(), floor), "D", color=COLORS[verdict], markersize=6)
    ax.set_xlabel(LABELS[sweep], fontsize=8)
    ax.tick_params(labelsize=7)
    ax.grid(visible=True, color="#e3e3e3", linewidth=0.7)
