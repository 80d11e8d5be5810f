"""docs/reference-conditions.md from the measured rows: verdicts, tables, figures."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from benchmarks.reference_conditions import claims, figures, responses
from benchmarks.reference_conditions.design import CONDITIONS, COUNT, COUNTS, FULL, MOST_COMPLETE, PLACES, TIMES
from benchmarks.reference_conditions.responses import at, full_row, image
from benchmarks.tables import table

Row = dict[str, Any]
#: a share of the compliance from which on a set counts as complete, and frequencies of the mechanism as right
COMPLETE, RESOLVED = 0.99, 0.01
HEAD = """# Reference conditions: a verdict

Made by `python -m benchmarks.reference_conditions` from its own runs; every number and every verdict on this page
follows from them by the rules that stand beside it. The kept numbers:
[measured.json](reference-conditions/measured.json).

Rod 1 of the 4-SPS/PS mechanism (the paper's Table 2, 12 elements) is joined at its upper end to the ball of A1 and, at
0, 60 or 120 mm from its lower end, to the prismatic joint; the paper does not say where. Five reference conditions are
compared with the full rod: every coordinate of its mesh. Fixed-fixed modes clamp the rod's two ends, as in the paper's
eq. (6); pinned-pinned, cantilever and Craig-Bampton hold the places of the joints. The paper prints six elastic
frequencies of either of its two sets; six cut a bending pair, seven do not, and its statements are judged with seven.
"""


def write(rows: dict[str, list[Row]], docs: Path) -> Path:
    """The page and its figures; groups without rows are left out."""
    folder = docs / "reference-conditions"
    folder.mkdir(parents=True, exist_ok=True)
    drawn = figures.write(rows, folder)
    parts = [HEAD, _short(rows)]
    if "far" in rows and "clearance" in rows:
        parts.append(_verdicts(rows))
    sections = {
        "statics": _statics,
        "frequencies": _frequencies,
        "far": responses.far,
        "clearance": responses.clearance,
        "mesh": _mesh,
    }
    for name, section in sections.items():
        if name in rows:
            parts.append(section(rows, drawn))
    page = docs / "reference-conditions.md"
    page.write_text("\n".join(parts))
    return page


def _short(rows: dict[str, list[Row]]) -> str:
    """Which conditions are right in each respect, with the least whole count from COUNT at every place."""
    lines = ["## In short\n", f"With {COUNT} coordinates (or the next whole count), at all three places:\n"]
    if "statics" in rows:
        good = [c for c in CONDITIONS if _least(rows["statics"], c, COUNT) >= COMPLETE]
        lines.append(f"- static compliance complete to {100.0 * COMPLETE:g} %: {_or_none(good)};")
    if "frequencies" in rows:
        good = [c for c in CONDITIONS if _frequency_error(rows["frequencies"], c) < RESOLVED]
        lines.append(f"- first three frequencies of the mechanism within {100.0 * RESOLVED:g} %: {_or_none(good)};")
    if "far" in rows:
        good = [c for c in CONDITIONS if all(_far_error(rows["far"], place, c) < claims.AGREE for place in PLACES)]
        lines.append(f"- effects of the rod with ideal joints within {100.0 * claims.AGREE:g} %: {_or_none(good)};")
    if "clearance" in rows:
        good = [c for c in CONDITIONS if all(_peak_right(rows["clearance"], place, c) for place in PLACES)]
        lines.append(
            f"- peak contact force within {100.0 * claims.AGREE:g} % of the most complete set's, beyond what that is "
            f"unsettled by: {_or_none(good)}."
        )
        enough = _enough(rows["clearance"])
        if enough is not None:
            lines.append(f"  - Craig-Bampton is so from {enough} coordinates (or the next whole count) on;")
        lines += [f"  - at {place} mm: {_peaks(rows['clearance'], place)}." for place in PLACES]
    return "\n".join(lines) + "\n"


def _or_none(names: list[str]) -> str:
    return ", ".join(names) or "none"


def _far_error(rows: list[Row], place: int, condition: str) -> float:
    return max(claims.off(at(rows, place, condition, COUNT), full_row(rows, place)).values())


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


def _verdicts(rows: dict[str, list[Row]]) -> str:
    lines = ["## What holds of the paper's statements\n"]
    for claim, outcomes in claims.verdicts(rows):
        lines.append(f"**{claim.paper}** {claims.sentence(outcomes)}")
        lines.append(f"Rule: {claim.rule[0].lower()}{claim.rule[1:]}\n")
        lines += [f"- {place} mm: {numbers}" for place, (_, numbers) in outcomes.items()]
        lines.append("")
    return "\n".join(lines)


def _statics(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    found = rows["statics"]
    body = []
    for condition in CONDITIONS:
        for n in (7, COUNT, max(COUNTS)):
            cells = [condition]
            at = [_nearest(found, place, condition, n) for place in PLACES]
            cells.append("/".join(dict.fromkeys(str(r["count"]) for r in at)))
            cells += [" ".join(_share(r[d]) for d in ("z", "x", "rz")) for r in at]
            body.append(cells)
    full = ["full", ""] + [
        f"{full_row(found, place)['z']:.3g}, {full_row(found, place)['x']:.3g}, {full_row(found, place)['rz']:.3g}"
        for place in PLACES
    ]
    head = ("condition", "coordinates", *(f"{place} mm" for place in PLACES))
    complete = [c for c in CONDITIONS if _least(found, c, COUNT) >= COMPLETE]
    never = [c for c in CONDITIONS if _least(found, c, max(COUNTS)) < 0.5]
    return (
        "## Static compliance\n\n"
        "Motion of the upper end under a force or torque there, the place of the prismatic joint held: axial, bending "
        "and torsion, per cent of the full rod (last line: m/N, m/N, rad/(N m)).\n\n"
        + table(head, [*body, full])
        + f"\n\nComplete (at least {100.0 * COMPLETE:g} % of each) with {COUNT} coordinates: "
        f"{_or_none(complete)}. "
        f"Below half with {max(COUNTS)} coordinates at some place: {_or_none(never)}.\n"
        + image("compliance.png", "Share of the compliance over the number of coordinates", drawn)
    )


def _nearest(rows: list[Row], place: int, condition: str, count: int) -> Row:
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition)]
    return max((r for r in of if r["count"] <= count + 1), key=lambda r: (r["count"] <= count, r["count"]))


def _least(rows: list[Row], condition: str, count: int) -> float:
    at = [_nearest(rows, place, condition, count) for place in PLACES]
    return min(r[d] for r in at for d in ("z", "x", "rz"))


def _share(value: float) -> str:
    return f"{100.0 * value:.1f}" if value > 1e-9 else "0"


def _frequencies(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    found, body = rows["frequencies"], []
    for place in PLACES:
        for condition in (FULL, *CONDITIONS):
            for time in TIMES:
                here = [r for r in found if (r["place_mm"], r["condition"], r["time"]) == (place, condition, time)]
                hertz = here[0]["frequency"]
                label = condition if condition == FULL else f"{condition} {here[0]['count']}"
                body.append([f"{place} mm", label, f"{time:g}", *(f"{f:.1f}" for f in hertz)])
    most = max(len(line) for line in body) - 3
    filled = [line + ["-"] * (most + 3 - len(line)) for line in body]
    head = ("joint at", "set", "time [s]", *(f"{k + 1}" for k in range(most)))
    right = [c for c in CONDITIONS if _frequency_error(found, c) < RESOLVED]
    return (
        "## Frequencies of the assembled mechanism\n\n"
        "The lowest vibrations [Hz] with ideal joints, drives held where they are at that time.\n\n"
        + table(head, filled)
        + f"\n\nThe first three within {100.0 * RESOLVED:g} % of the full rod's at every place and time: "
        f"{_or_none(right)}.\n" + image("frequencies.png", "Errors of the mechanism's frequencies at the start", drawn)
    )


def _frequency_error(rows: list[Row], condition: str) -> float:
    worst = 0.0
    for row in (r for r in rows if r["condition"] == condition):
        same = (row["place_mm"], FULL, row["time"])
        full = next(r for r in rows if (r["place_mm"], r["condition"], r["time"]) == same)["frequency"][:3]
        off = [abs(a / b - 1.0) for a, b in zip(row["frequency"], full, strict=False)]
        worst = max([worst, *off] if len(off) == len(full) else [1.0])
    return worst


def _mesh(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    found = rows["mesh"]
    finest = found[-1]["frequency"]
    body = [
        [str(r["elements"]), *(f"{100.0 * (f / g - 1.0):.4f} %" for f, g in zip(r["frequency"], finest, strict=True))]
        for r in found[:-1]
    ]
    text = (
        "## Number of elements\n\n"
        f"Frequencies of the {COUNT} Craig-Bampton coordinates (joint at 0 mm), clamped at the joint, against those of "
        f"{found[-1]['elements']} elements.\n\n"
        + table(("elements", *(str(k + 1) for k in range(len(finest)))), body)
        + "\n"
    )
    if "far" not in rows:
        return text
    runs = sorted((r for r in rows["far"] if _is_mesh_study(r)), key=lambda r: r["finer"])
    elements = found[0]["elements"]
    effect = [
        [
            str(elements * r["finer"]),
            f"{r['angle']:.6e}",
            f"{1e3 * r['displacement']:.6e}",
            f"{1e3 * r['velocity']:.6f}",
        ]
        for r in runs
    ]
    head = ("elements", "angle [rad]", "z [mm]", "v [mm/s]")
    return text + "\nDeviation of the platform from ideal, ideal joints:\n\n" + table(head, effect) + "\n"


def _is_mesh_study(row: Row) -> bool:
    return (row["place_mm"], row["condition"], row["count"]) == (next(iter(PLACES)), "craig-bampton", COUNT)
