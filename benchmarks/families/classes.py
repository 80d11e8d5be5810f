"""Classes of hard cases of the stability atlas: one small scene each, with what is known of it."""

from __future__ import annotations

import time

from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Family, Record, each
from benchmarks.page import Columns, table
from benchmarks.stability.classes import CASES
from flexclear.pipeline.core.system.errors import FlexclearError

COLUMNS: Columns = {
    "case": lambda r: r["case"],
    "outcome": lambda r: r["verdict"],
    "compared": lambda r: r["compared"],
    "largest deviation": lambda r: "–" if r["deviation"] is None else f"{r['deviation']:.1e}",
    "counts as wrong above": lambda r: f"{r['limit']:.0e}" if r["limit"] else "–",
}


def examined(name: str) -> Record:
    """What became of a case: `verdict`, `reason`, largest `deviation` from what is known, seconds with compiling."""
    case, begun, deviation, reason = CASES[name], time.process_time(), None, ""
    try:
        deviation = case.examine(case.scene())
        verdict = FINISHED if deviation < case.limit else WRONG
        reason = "" if verdict == FINISHED else f"off by {deviation:.1e}, where it should be below {case.limit:.0e}"
    except FlexclearError as error:
        verdict, reason = REFUSED if case.refused and case.refused in str(error) else WRONG, str(error)
    except ArithmeticError as error:
        verdict, reason = WRONG, str(error)
    facts = {"compared": case.compared, "limit": case.limit, "deviation": deviation}
    return {"verdict": verdict, "reason": reason, **facts, "seconds": time.process_time() - begun}


def show(records: list[Record]) -> str:
    """A table, and what was said of what did not finish."""
    said = [f"- {r['case']} ({r['verdict']}): {' '.join(r['reason'].split())}" for r in records if r["reason"]]
    return table(records, COLUMNS) + ("\n\nWhat did not finish said:\n\n" + "\n".join(said) + "\n" if said else "")


def modules(case: Case) -> set[str]:
    """What decides about a case: its scene and the dynamics."""
    del case
    return {"benchmarks.stability.classes", "flexclear.pipeline.dynamics"}


FAMILY = Family(
    what="classes of hard cases, each with a closed form, a second computation or a refusal",
    takes="2 min",
    page="stability.md",
    cases=lambda: [Case(name) for name in CASES],
    measure=each(lambda case: [examined(case.name)]),
    show=show,
    times=False,
    modules=modules,
)
