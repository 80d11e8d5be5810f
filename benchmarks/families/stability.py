"""docs/stability.md from the rows of the atlas: what finished, what was refused and why, figures, the case list."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.stability import figures
from benchmarks.stability.cases import Case
from benchmarks.stability.outcome import CLOSURE, DEVIATION, FINISHED, LEDGER, REFUSED, WRONG, Outcome

TEXT = """# Stability atlas

Made by `{command}`; nothing on this page is typed in. Each case is the 4-SPS/PS mechanism with one parameter moved over
its range, or a random point of all of them (seed {seed}). Parameters and results of every case, to the last digit:
[{table}]({table}). `make atlas` runs all of it again, and goes on where it was interrupted.

- **{finished} of {total} finished**, {refused} were refused ({share:.1f} %), {wrong} finished wrong or failed.
- Largest energy error of a finished run: {ledger:.1e} of the largest energy in its ledger, median {middle:.1e} (more
  than {limit:g} counts as wrong); largest opening of a loop {closure:.1e} m (more than {open:g} counts as wrong).
- {compared} finished runs were repeated at a hundred times tighter tolerance: up to the horizon the platform's
  velocity differs by at most {deviation:.1e} of its largest, median {median:.1e} (more than {far:g} counts as wrong).
- Dearest case: {evaluations} evaluations, {seconds:.0f} s of processor time; all cases {hours:.1f} minutes.
- Methods: {methods}.

{reasons}
## One parameter at a time

![What each parameter costs](stability/sweeps.png)

Evaluations over each parameter; the other parameters are the paper's, whose own value is dotted. A diamond below is a
refusal, a cross a run that finished wrong; rings are runs that an implicit method took over.

![Energy errors](stability/ledger.png)

Energy error over each parameter, as a share of the largest energy in the run's ledger.

![Horizon](stability/horizon.png)

How much of each run can be believed point by point: the share of its time before it and a twin, started a tolerance
away, part visibly. Beyond that a run is one draw out of many, however well its ledger closes.

## All parameters at once

![Random points](stability/random.png)

Every random point in four planes of its parameters, coloured by its energy error and by its cost; the numbers of joints
are spread a little, so that points do not hide each other.

| sweep | cases | finished | refused | wrong | largest energy error | largest deviation | most evaluations |
|---|---:|---:|---:|---:|---:|---:|---:|
{rows}
"""


@dataclass(frozen=True)
class Row:
    """A case and what became of it."""

    case: Case
    outcome: Outcome

    @property
    def value(self) -> float:
        """The parameter that the sweep moves; not a number for random points."""
        return float(getattr(self.case.parameters, self.case.sweep, float("nan")))

    def flat(self) -> dict[str, Any]:
        """Parameters and outcome in one table row; text as it is, floats to all digits that matter."""
        numbers = {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(self.outcome).items()}
        return {"sweep": self.case.sweep, **asdict(self.case.parameters), **numbers}

    def told(self) -> str:
        """One line about the row."""
        found, place = self.outcome, "" if self.case.sweep == "random" else f" {self.value:.6g}"
        numbers = f"{found.evaluations} evaluations, energy {found.ledger:.1e}, deviation {found.deviation:.1e}"
        said = found.reason or found.switched
        return f"{self.case.sweep}{place}: {found.verdict} {numbers}, {found.seconds:.1f} s {found.method} {said}"


def write(rows: Sequence[Row], docs: Path, seed: int, command: str) -> Path:
    """The page, its figures and the table of all cases, below `docs`; returns the page."""
    folder = docs / "stability"
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / f"cases_{seed}.csv"
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0].flat()), lineterminator="\n")
        writer.writeheader()
        writer.writerows(row.flat() for row in rows)
    figures.write(rows, folder)
    page = docs / "stability.md"
    page.write_text(text(rows, seed, command, f"stability/{table.name}"))
    return page


def text(rows: Sequence[Row], seed: int, command: str, table: str) -> str:
    """The page."""
    verdicts = Counter(row.outcome.verdict for row in rows)
    done = [row.outcome for row in rows if row.outcome.verdict == FINISHED]
    deviation = np.array([o.deviation for o in done if np.isfinite(o.deviation)])
    ledger = np.array([o.ledger for o in done])
    return TEXT.format(
        command=command,
        seed=seed,
        table=table,
        total=len(rows),
        finished=verdicts[FINISHED],
        refused=verdicts[REFUSED],
        share=100.0 * verdicts[REFUSED] / len(rows),
        wrong=verdicts[WRONG],
        ledger=ledger.max(initial=0.0),
        middle=float(np.median(ledger)) if len(ledger) else 0.0,
        limit=LEDGER,
        closure=max((o.closure for o in done), default=0.0),
        open=CLOSURE,
        far=DEVIATION,
        compared=len(deviation),
        deviation=deviation.max(initial=0.0),
        median=float(np.median(deviation)) if len(deviation) else 0.0,
        evaluations=max(row.outcome.evaluations for row in rows),
        seconds=max(row.outcome.seconds for row in rows),
        hours=sum(row.outcome.seconds for row in rows) / 60.0,
        methods=_methods(done),
        reasons=_reasons(rows),
        rows="\n".join(
            _line(name, [r.outcome for r in rows if r.case.sweep == name])
            for name in dict.fromkeys(r.case.sweep for r in rows)
        ),
    )


def _methods(done: Sequence[Outcome]) -> str:
    counted = Counter(f"{o.method}, which took over" if o.switched else o.method for o in done)
    return "; ".join(f"{name}: {count}" for name, count in counted.most_common())


def _reasons(rows: Sequence[Row]) -> str:
    """What the cases said that did not finish, with their numbers."""
    told = [
        f"- {row.outcome.verdict} ({_place(row)}): {' '.join(row.outcome.reason.split())}\n"
        for row in rows
        if row.outcome.verdict != FINISHED
    ]
    return f"What did not finish said:\n\n{''.join(told)}" if told else ""


def _place(row: Row) -> str:
    if row.case.sweep != "random":
        return f"{row.case.sweep} {row.value:.4g}"
    return "random: " + ", ".join(f"{k} {v:.4g}" for k, v in asdict(row.case.parameters).items())


def _line(name: str, found: list[Outcome]) -> str:
    verdicts = Counter(o.verdict for o in found)
    ledger = max((o.ledger for o in found if np.isfinite(o.ledger)), default=float("nan"))
    deviation = max((o.deviation for o in found if np.isfinite(o.deviation)), default=float("nan"))
    counts = " | ".join(str(verdicts[v]) for v in (FINISHED, REFUSED, WRONG))
    most = max(o.evaluations for o in found)
    return f"| {name} | {len(found)} | {counts} | {ledger:.1e} | {deviation:.1e} | {most} |"
