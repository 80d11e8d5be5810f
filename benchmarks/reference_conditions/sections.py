"""Tables on the page of reference conditions, one or two for each group of rows."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.family import Record as Row
from benchmarks.page import table
from benchmarks.reference_conditions import claims
from benchmarks.reference_conditions.claims import at
from benchmarks.reference_conditions.design import (
    CONDITIONS,
    COUNT,
    COUNTS,
    FULL,
    MOST_COMPLETE,
    PLACES,
    RIGID,
)
from pipeline.post.plotting.table import pipe_table

#: a share of the compliance from which on a set counts as complete, and frequencies of the mechanism as right
COMPLETE, RESOLVED = 0.99, 0.01
Columns = dict[str, Callable[[Row], str]]
SET: Columns = {"joint at": lambda r: f"{r['place_mm']} mm", "set": lambda r: label(r)}
COST: Columns = {"evaluations": lambda r: str(r["evaluations"]), "seconds": lambda r: f"{r['seconds']:.2f}"}


def statics(rows: dict[str, list[Row]]) -> str:
    """Shares of the full rod's compliance, that compliance in the last line, and which sets are complete."""
    found, body = rows["statics"], []
    for condition in CONDITIONS:
        for n in (7, COUNT, max(COUNTS)):
            near = [_nearest(found, place, condition, n) for place in PLACES]
            shares = [" ".join(_share(r[d]) for d in ("z", "x", "rz")) for r in near]
            body.append([condition, "/".join(dict.fromkeys(str(r["count"]) for r in near)), *shares])
    full = [", ".join(f"{at(found, place, FULL)[d]:.3g}" for d in ("z", "x", "rz")) for place in PLACES]
    head = ("condition", "coordinates", *(f"{place} mm" for place in PLACES))
    complete = [c for c in CONDITIONS if least(found, c, COUNT) >= COMPLETE]
    never = [c for c in CONDITIONS if least(found, c, max(COUNTS)) < 0.5]
    return (
        f"{pipe_table(head, [*body, [FULL, '', *full]])}\n\n"
        f"Complete (at least {100.0 * COMPLETE:g} % of each) with {COUNT} coordinates: {or_none(complete)}. "
        f"Below half with {max(COUNTS)} coordinates at some place: {or_none(never)}."
    )


def _nearest(rows: list[Row], place: int, condition: str, count: int) -> Row:
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition)]
    return max((r for r in of if r["count"] <= count + 1), key=lambda r: (r["count"] <= count, r["count"]))


def least(rows: list[Row], condition: str, count: int) -> float:
    """The least share of the compliance, over places and directions."""
    near = [_nearest(rows, place, condition, count) for place in PLACES]
    return min(r[d] for r in near for d in ("z", "x", "rz"))


def _share(value: float) -> str:
    return f"{100.0 * value:.1f}" if value > 1e-9 else "0"


def frequencies(rows: dict[str, list[Row]]) -> str:
    """Vibrations of the mechanism, and with which sets they are right."""
    names = (FULL, *CONDITIONS)
    found = sorted(rows["frequencies"], key=lambda r: (r["place_mm"], names.index(r["condition"]), r["time"]))
    most = max(len(r["frequency"]) for r in found)
    columns = SET | {"time [s]": lambda r: f"{r['time']:g}"} | {f"{k + 1}": _vibration(k) for k in range(most)}
    right = [c for c in CONDITIONS if frequency_error(found, c) < RESOLVED]
    return (
        f"{table(found, columns)}\n\n"
        f"The first three within {100.0 * RESOLVED:g} % of the full rod's at every place and time: {or_none(right)}."
    )


def _vibration(k: int) -> Callable[[Row], str]:
    return lambda r: f"{r['frequency'][k]:.1f}" if k < len(r["frequency"]) else "-"


def frequency_error(rows: list[Row], condition: str) -> float:
    """Largest error of the first three, as a share; a set that has fewer of them is wholly wrong."""
    worst = 0.0
    for row in (r for r in rows if r["condition"] == condition):
        same = (row["place_mm"], FULL, row["time"])
        full = next(r for r in rows if (r["place_mm"], r["condition"], r["time"]) == same)["frequency"][:3]
        off = [abs(a / b - 1.0) for a, b in zip(row["frequency"], full, strict=False)]
        worst = max([worst, *off] if len(off) == len(full) else [1.0])
    return worst


def far(rows: dict[str, list[Row]]) -> str:
    """Ideal joints: effects of the rod, errors, cost."""
    shown = [r for r in sorted(rows["far"], key=_order) if r["finer"] == 1 and r["condition"] != RIGID]
    columns: Columns = {
        "angle [rad]": lambda r: f"{r['angle']:.2e}",
        "z [mm]": lambda r: f"{1e3 * r['displacement']:.2e}",
        "v [mm/s]": lambda r: f"{1e3 * r['velocity']:.3g}",
        "force [N]": lambda r: f"{r['force']:.2f}",
        "off by": lambda r: f"{100.0 * far_error(rows['far'], r):.3g} %",
        "pointwise": lambda r: f"{100.0 * r['velocity_error']:.3g} %",
    }
    return table(shown, SET | columns | COST)


def far_error(rows: list[Row], row: Row) -> float:
    """The worst of the largest effects of a set, as a share of the full rod's."""
    return max(claims.off(row, at(rows, row["place_mm"], FULL)).values())


def clearance(rows: dict[str, list[Row]]) -> str:
    """Clearance: means and spreads over the members, and why the complete basis is not among the sets."""
    columns: Columns = {
        "members": lambda r: str(r["members"]),
        "peak force [N]": lambda r: _spread(r, "peak_force", 1.0, 0),
        "impacts": lambda r: _spread(r, "impacts", 1.0, 1),
        "angle [mrad]": lambda r: _spread(r, "angle", 1e3, 3),
        "z [mm]": lambda r: _spread(r, "displacement", 1e3, 4),
        "v [mm/s]": lambda r: _spread(r, "velocity", 1e3, 2),
        "acceleration [m/s²]": lambda r: _spread(r, "acceleration", 1.0, 0),
    }
    more = f"{' and '.join(map(str, MOST_COMPLETE))} coordinates beside {COUNT} show what more would change."
    return f"{_why_not_all(rows)}{more}\n\n{table(sorted(rows['clearance'], key=_order), SET | columns | COST)}"


def _why_not_all(rows: dict[str, list[Row]]) -> str:
    """Why no ensemble has the complete basis, with the numbers."""
    if "statics" not in rows or "far" not in rows:
        return ""
    highest = 1e-3 * at(rows["statics"], 0, FULL)["highest"]
    full, best = at(rows["far"], 0, FULL), at(rows["far"], 0, "craig-bampton", COUNT)
    return (
        f"The complete basis reaches up to {highest:.0f} kHz, a run with it takes "
        f"{full['seconds'] / best['seconds']:.0f} times that of {COUNT} Craig-Bampton coordinates, and with ideal "
        f"joints those are within {100.0 * far_error(rows['far'], best):.2g} % of it; it has no ensemble here. "
    )


def mesh(rows: dict[str, list[Row]]) -> str:
    """Frequencies of coarser meshes against the finest, and what the mesh changes in a run."""
    *coarse, finest = rows["mesh"]
    n = len(finest["frequency"])
    columns: Columns = {"elements": lambda r: str(r["elements"])} | {f"{k + 1}": _finer(k, finest) for k in range(n)}
    parts = [f"{COUNT} coordinates, against those of {finest['elements']} elements:", table(coarse, columns)]
    runs = [r for r in rows.get("far", []) if _is_mesh_study(r)]
    effects: Columns = {
        "elements": lambda r: str(rows["mesh"][0]["elements"] * r["finer"]),
        "angle [rad]": lambda r: f"{r['angle']:.6e}",
        "z [mm]": lambda r: f"{1e3 * r['displacement']:.6e}",
        "v [mm/s]": lambda r: f"{1e3 * r['velocity']:.6f}",
    }
    if runs:
        parts.append("Deviation of the platform from ideal, ideal joints:")
        parts.append(table(sorted(runs, key=lambda r: r["finer"]), effects))
    return "\n\n".join(parts)


def _finer(k: int, finest: Row) -> Callable[[Row], str]:
    return lambda r: f"{100.0 * (r['frequency'][k] / finest['frequency'][k] - 1.0):.4f} %"


def _is_mesh_study(row: Row) -> bool:
    return (row["place_mm"], row["condition"], row["count"]) == (next(iter(PLACES)), "craig-bampton", COUNT)


def label(row: Row) -> str:
    """Name of a mode set."""
    return row["condition"] if row["condition"] in (FULL, RIGID) else f"{row['condition']} {row['count']}"


def _order(row: Row) -> tuple[int, int, int]:
    names = (RIGID, *CONDITIONS, FULL)
    return row["place_mm"], names.index(row["condition"]), row["count"]


def _spread(row: Row, name: str, factor: float, digits: int) -> str:
    mean = f"{factor * row[name]:.{digits}f}"
    return mean if row["members"] == 1 else f"{mean} ± {factor * row[f'{name}_std']:.{digits}f}"


def or_none(names: list[str]) -> str:
    """Names in a sentence."""
    return ", ".join(names) or "none"
