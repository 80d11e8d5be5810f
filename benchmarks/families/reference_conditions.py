"""The verdict on reference conditions: which mode sets of rod 1 give the answers of the full rod, and at what cost."""

from __future__ import annotations

import math

from benchmarks.family import Family
from benchmarks.family import Record as Row
from benchmarks.reference_conditions import claims, figures, runs, sections
from benchmarks.reference_conditions.claims import at
from benchmarks.reference_conditions.design import CONDITIONS, COUNT, MOST_COMPLETE, PLACES
from benchmarks.reference_conditions.sections import COMPLETE, RESOLVED, far_error, frequency_error, least, or_none

#: tables by group of rows
SECTIONS = {
    "statics": sections.statics,
    "frequencies": sections.frequencies,
    "far": sections.far,
    "clearance": sections.clearance,
    "mesh": sections.mesh,
}


def show(records: list[Row]) -> dict[str, str]:
    """In short, the paper's statements, and the tables of each group of rows that is there."""
    rows = {name: of for name in SECTIONS if (of := [r for r in records if r["case"] == name])}
    judged = {"claims": claims.told(rows)} if "far" in rows and "clearance" in rows else {}
    return {"short": _short(rows)} | judged | {name: SECTIONS[name](rows) for name in rows}


def _short(rows: dict[str, list[Row]]) -> str:
    """Which conditions are right in each respect, with the least whole count from COUNT at every place."""
    lines = [f"With {COUNT} coordinates (or the next whole count), at all three places:\n"]
    if "statics" in rows:
        good = [c for c in CONDITIONS if least(rows["statics"], c, COUNT) >= COMPLETE]
        lines.append(f"- static compliance complete to {100.0 * COMPLETE:g} %: {or_none(good)};")
    if "frequencies" in rows:
        good = [c for c in CONDITIONS if frequency_error(rows["frequencies"], c) < RESOLVED]
        lines.append(f"- first three frequencies of the mechanism within {100.0 * RESOLVED:g} %: {or_none(good)};")
    if "far" in rows:
        good = [
            c
            for c in CONDITIONS
            if all(far_error(rows["far"], at(rows["far"], place, c, COUNT)) < claims.AGREE for place in PLACES)
        ]
        lines.append(f"- effects of the rod with ideal joints within {100.0 * claims.AGREE:g} %: {or_none(good)};")
    if "clearance" in rows:
        good = [c for c in CONDITIONS if all(_peak_right(rows["clearance"], place, c) for place in PLACES)]
        lines.append(
            f"- peak contact force within {100.0 * claims.AGREE:g} % of the most complete set's, beyond what that is "
            f"unsettled by: {or_none(good)}."
        )
        enough = _enough(rows["clearance"])
        if enough is not None:
            lines.append(f"  - Craig-Bampton is so from {enough} coordinates (or the next whole count) on;")
        lines += [f"  - at {place} mm: {_peaks(rows['clearance'], place)}." for place in PLACES]
    return "\n".join(lines) + "\n"


def _peak_error(rows: list[Row], place: int, condition: str, count: int = COUNT) -> float:
    best = claims.Rows([], [r for r in rows if r["place_mm"] == place]).best()["peak_force"]
    return float(abs(at(rows, place, condition, count)["peak_force"] / best - 1.0))


def _peak_right(rows: list[Row], place: int, condition: str) -> bool:
    return _peak_error(rows, place, condition) - _unsettled(rows, place) < claims.AGREE


def _unsettled(rows: list[Row], place: int) -> float:
    here = claims.Rows([], [r for r in rows if r["place_mm"] == place])
    share = claims.unsettled(here) / here.best()["peak_force"]
    return 0.0 if math.isnan(share) else share


def _enough(rows: list[Row]) -> int | None:
    """The least count from which on Craig-Bampton has the peak force at every place."""
    measured = {place: {r["count"] for r in rows if _is_craig_bampton(r, place)} for place in PLACES}
    known = [n for n in (COUNT, *MOST_COMPLETE) if all(max(counts) >= n for counts in measured.values())]
    good = [all(_peak_error(rows, p, "craig-bampton", n) < claims.AGREE for p in PLACES) for n in known]
    return next((n for k, n in enumerate(known) if all(good[k:])), None)


def _is_craig_bampton(row: Row, place: int) -> bool:
    return (row["condition"], row["place_mm"]) == ("craig-bampton", place)


def _peaks(rows: list[Row], place: int) -> str:
    errors = ", ".join(f"{c} {100.0 * _peak_error(rows, place, c):.1f} %" for c in CONDITIONS)
    settled = f"{100.0 * _unsettled(rows, place):.1f} %"
    return f"off by {errors}, the reference itself being settled to {settled}"


FAMILY = Family(
    what="which mode sets of a rod give the answers of the full rod, and at what cost",
    takes="40 min on two cores",
    page="reference-conditions.md",
    cases=runs.cases,
    measure=runs.measure,
    show=show,
    files=figures.files,
    quick="mesh",
    settings={"members": 8},
    times=False,
)
