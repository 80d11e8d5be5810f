"""The stability atlas: hard cases of the clearance mechanism, and what became of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.family import FINISHED, REFUSED, WRONG, Family, Record
from benchmarks.stability import figures, runs, scenes
from benchmarks.stability.runs import CLOSURE, DEVIATION, LEDGER
from flexclear.pipeline.post.plotting.table import pipe_table

TEXT = """{seeds}Parameters and results of every case, to the last digit: [its log](../benchmarks/log/stability.jsonl).

- **{finished} of {total} finished**, {refused} were refused ({fraction:.1f} %), {wrong} finished wrong or failed.
- Largest energy error of a finished run: {ledger:.1e} of the largest energy in its ledger, median {middle:.1e} (more
  than {limit:g} counts as wrong); largest opening of a loop {closure:.1e} m (more than {open:g} counts as wrong).
- {compared} finished runs were repeated at a hundred times tighter tolerance: up to the horizon the platform's
  velocity differs by at most {deviation:.1e} of its largest, median {median:.1e} (more than {far:g} counts as wrong).
- Dearest case: {evaluations} evaluations, {seconds:.0f} s of processor time; all cases {minutes:.1f} minutes.
- Methods: {methods}.

{reasons}
{table}
"""


def show(records: list[Record]) -> str:
    """What finished, what was refused and why, and the worst of each sweep."""
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
    """What the cases said that did not finish, with their numbers."""
    lines = [
        f"- {r['verdict']} ({_place(r)}): {' '.join(r['reason'].split())}\n"
        for r in records
        if r["verdict"] != FINISHED
    ]
    return f"What did not finish said:\n\n{''.join(lines)}" if lines else ""


def _place(record: Record) -> str:
    if record["sweep"] != "random":
        return f"{record['sweep']} {record['parameters'][record['sweep']]:.4g}"
    return "random: " + ", ".join(f"{name} {value:.4g}" for name, value in record["parameters"].items())


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


FAMILY = Family(
    what="301 hard cases, and what becomes of each",
    takes="30 min on two cores",
    page="stability.md",
    cases=scenes.cases,
    measure=runs.measure,
    show=show,
    files=figures.files,
    settings={"seed": 20190310, "random": 200},
    times=False,
    modules=runs.modules,
    children=True,
)
