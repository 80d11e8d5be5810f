"""docs/reference-conditions.md from the measured rows: verdicts, tables, figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.reference_conditions import claims, figures
from benchmarks.reference_conditions.design import CONDITIONS, COUNT, COUNTS, FULL, PLACES, RIGID, TIMES
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
    parts = [HEAD]
    if "far" in rows and "clearance" in rows:
        parts.append(_verdicts(rows))
    sections = {
        "statics": _statics,
        "frequencies": _frequencies,
        "far": _far,
        "clearance": _clearance,
        "mesh": _mesh,
    }
    for name, section in sections.items():
        if name in rows:
            parts.append(section(rows, drawn))
    page = docs / "reference-conditions.md"
    page.write_text("\n".join(parts))
    return page


def _verdicts(rows: dict[str, list[Row]]) -> str:
    lines = ["## What holds of the paper's statements\n"]
    for claim, outcomes in claims.verdicts(rows):
        lines.append(f"**{claim.paper}** {claims.sentence(outcomes)}")
        lines.append(f"Rule: {claim.rule[0].lower()}{claim.rule[1:]}\n")
        lines += [f"- {place} mm: {numbers}" for place, (_, numbers) in outcomes.items()]
        lines.append("")
    return "\n".join(lines)


def _image(name: str, words: str, drawn: list[str]) -> str:
    return f"\n![{words}](reference-conditions/{name})\n" if name in drawn else ""


def _at(rows: list[Row], place: int, condition: str, count: int) -> Row:
    """The row of a condition with the least count that is not below `count`."""
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition) and r.get("finer", 1) == 1]
    return min((r for r in of if r["count"] >= count), key=lambda r: r["count"])


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
        f"{_row(found, place)['z']:.3g}, {_row(found, place)['x']:.3g}, {_row(found, place)['rz']:.3g}"
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
        f"{', '.join(complete) or 'none'}. "
        f"Below half with {max(COUNTS)} coordinates at some place: {', '.join(never) or 'none'}.\n"
        + _image("compliance.png", "Share of the compliance over the number of coordinates", drawn)
    )


def _nearest(rows: list[Row], place: int, condition: str, count: int) -> Row:
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition)]
    return max((r for r in of if r["count"] <= count + 1), key=lambda r: (r["count"] <= count, r["count"]))


def _row(rows: list[Row], place: int) -> Row:
    return next(r for r in rows if r["place_mm"] == place and r["condition"] == FULL)


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
        f"{', '.join(right) or 'none'}.\n"
        + _image("frequencies.png", "Errors of the mechanism's frequencies at the start", drawn)
    )


def _frequency_error(rows: list[Row], condition: str) -> float:
    worst = 0.0
    for row in (r for r in rows if r["condition"] == condition):
        same = (row["place_mm"], FULL, row["time"])
        full = next(r for r in rows if (r["place_mm"], r["condition"], r["time"]) == same)["frequency"][:3]
        off = [abs(a / b - 1.0) for a, b in zip(row["frequency"], full, strict=False)]
        worst = max([worst, *off] if len(off) == len(full) else [1.0])
    return worst


def _far(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    body = [
        [
            f"{r['place_mm']} mm",
            _label(r),
            f"{r['angle']:.2e}",
            f"{1e3 * r['displacement']:.2e}",
            f"{1e3 * r['velocity']:.3f}",
            f"{r['force']:.2f}",
            f"{100.0 * r['velocity_error']:.2g} %",
            f"{100.0 * r['force_error']:.2g} %",
            str(r["evaluations"]),
            f"{r['seconds']:.2f}",
        ]
        for r in sorted(rows["far"], key=_order)
        if r["finer"] == 1 and r["condition"] != RIGID
    ]
    head = (
        "joint at",
        "set",
        "angle [rad]",
        "z [mm]",
        "v [mm/s]",
        "force [N]",
        "v error",
        "force error",
        "evaluations",
        "seconds",
    )
    return (
        "## Ideal joints (FAR)\n\n"
        "Largest deviation of the platform, and of the force at A1, from the ideal mechanism; then the largest "
        "difference of velocity and force from the run with the full rod, as a share of the full rod's effect. No "
        "damping. Seconds are processor time of a warm run.\n\n"
        + table(head, body)
        + "\n"
        + _image("far.png", "Errors over the number of coordinates, and over the place of the joint", drawn)
    )


def _clearance(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    body = [
        [
            f"{r['place_mm']} mm",
            _label(r),
            str(r["members"]),
            _spread(r, "peak_force", 1.0, 0),
            _spread(r, "impacts", 1.0, 1),
            _spread(r, "angle", 1e3, 3),
            _spread(r, "displacement", 1e3, 4),
            _spread(r, "velocity", 1e3, 2),
            _spread(r, "acceleration", 1.0, 0),
            str(r["evaluations"]),
            f"{r['seconds']:.2f}",
        ]
        for r in sorted(rows["clearance"], key=_order)
    ]
    head = (
        "joint at",
        "set",
        "members",
        "peak force [N]",
        "impacts",
        "angle [mrad]",
        "z [mm]",
        "v [mm/s]",
        "acceleration [m/s²]",
        "evaluations",
        "seconds",
    )
    return (
        "## Clearance at A1 (FAR-CSJ)\n\n"
        "Mean ± standard deviation over the members of an ensemble (starts that differ by 1e-8 m), since single runs "
        "mean nothing beyond some tens of milliseconds; one run of the rigid rod. Largest deviations of the platform "
        "are from the ideal mechanism."
        + _why_not_all(rows)
        + " 25 coordinates beside 13 show what more would change.\n\n"
        + table(head, body)
        + "\n"
        + _image("clearance.png", "Peak contact forces", drawn)
    )


def _why_not_all(rows: dict[str, list[Row]]) -> str:
    """Why no ensemble has the complete basis, with the numbers."""
    if "statics" not in rows or "far" not in rows:
        return ""
    highest = 1e-3 * _row(rows["statics"], 0)["highest"]
    full, best = (_at(rows["far"], 0, c, n) for c, n in ((FULL, 0), ("craig-bampton", COUNT)))
    times = full["seconds"] / best["seconds"]
    return (
        f" The complete basis reaches up to {highest:.0f} kHz, a run with it takes {times:.0f} times that of {COUNT} "
        f"Craig-Bampton coordinates, and with ideal joints those are within {100.0 * best['velocity_error']:.2g} % of "
        "it; it has no ensemble here."
    )


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


def _label(row: Row) -> str:
    return row["condition"] if row["condition"] in (FULL, RIGID) else f"{row['condition']} {row['count']}"


def _order(row: Row) -> tuple[int, int, int]:
    names = (RIGID, *CONDITIONS, FULL)
    return row["place_mm"], names.index(row["condition"]), row["count"]


def _spread(row: Row, name: str, factor: float, digits: int) -> str:
    mean = f"{factor * row[name]:.{digits}f}"
    return mean if row["members"] == 1 else f"{mean} ± {factor * row[f'{name}_std']:.{digits}f}"
