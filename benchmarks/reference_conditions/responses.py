"""Sections of the verdict page on the mechanism's response, with ideal joints and with clearance."""

from __future__ import annotations

from typing import Any

from benchmarks.reference_conditions import claims
from benchmarks.reference_conditions.design import CONDITIONS, COUNT, FULL, MOST_COMPLETE, RIGID
from benchmarks.tables import table

Row = dict[str, Any]


def far(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    """Ideal joints: effects of the rod, errors, cost."""
    body = [
        [
            f"{r['place_mm']} mm",
            label(r),
            f"{r['angle']:.2e}",
            f"{1e3 * r['displacement']:.2e}",
            f"{1e3 * r['velocity']:.3g}",
            f"{r['force']:.2f}",
            f"{100.0 * max(claims.off(r, full_row(rows['far'], r['place_mm'])).values()):.3g} %",
            f"{100.0 * r['velocity_error']:.3g} %",
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
        "off by",
        "pointwise",
        "evaluations",
        "seconds",
    )
    return (
        "## Ideal joints (FAR)\n\n"
        "Largest deviation of the platform, and of the force at A1, from the ideal mechanism. *Off by*: the worst of "
        "these four, as a share of the full rod's. *Pointwise*: largest difference of the velocity from that with the "
        "full rod at one time, as a share of its effect; the rod rings without damping, so a frequency that is a "
        "little wrong is out of phase before the end, and the two differ by up to twice the effect. Seconds are "
        "processor time of a warm run.\n\n"
        + table(head, body)
        + "\n"
        + image("far.png", "Errors over the number of coordinates, and over the place of the joint", drawn)
    )


def clearance(rows: dict[str, list[Row]], drawn: list[str]) -> str:
    """Clearance: means and spreads over the members."""
    body = [
        [
            f"{r['place_mm']} mm",
            label(r),
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
        + f" {' and '.join(map(str, MOST_COMPLETE))} coordinates beside {COUNT} show what more would change.\n\n"
        + table(head, body)
        + "\n"
        + image("clearance.png", "Peak contact forces", drawn)
    )


def _why_not_all(rows: dict[str, list[Row]]) -> str:
    """Why no ensemble has the complete basis, with the numbers."""
    if "statics" not in rows or "far" not in rows:
        return ""
    highest = 1e-3 * full_row(rows["statics"], 0)["highest"]
    full, best = (at(rows["far"], 0, c, n) for c, n in ((FULL, 0), ("craig-bampton", COUNT)))
    error = 100.0 * max(claims.off(best, full).values())
    times = full["seconds"] / best["seconds"]
    return (
        f" The complete basis reaches up to {highest:.0f} kHz, a run with it takes {times:.0f} times that of {COUNT} "
        f"Craig-Bampton coordinates, and with ideal joints those are within {error:.2g} % of "
        "it; it has no ensemble here."
    )


def at(rows: list[Row], place: int, condition: str, count: int) -> Row:
    """The row of a condition with the least count that is not below `count`."""
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition) and r.get("finer", 1) == 1]
    return min((r for r in of if r["count"] >= count), key=lambda r: r["count"])


def full_row(rows: list[Row], place: int) -> Row:
    """The full rod's row at a place."""
    return next(r for r in rows if r["place_mm"] == place and r["condition"] == FULL)


def image(name: str, words: str, drawn: list[str]) -> str:
    """A figure of the page, if it was drawn."""
    return f"\n![{words}](reference-conditions/{name})\n" if name in drawn else ""


def label(row: Row) -> str:
    """Name of a mode set."""
    return row["condition"] if row["condition"] in (FULL, RIGID) else f"{row['condition']} {row['count']}"


def _order(row: Row) -> tuple[int, int, int]:
    names = (RIGID, *CONDITIONS, FULL)
    return row["place_mm"], names.index(row["condition"]), row["count"]


def _spread(row: Row, name: str, factor: float, digits: int) -> str:
    mean = f"{factor * row[name]:.{digits}f}"
    return mean if row["members"] == 1 else f"{mean} ± {factor * row[f'{name}_std']:.{digits}f}"
