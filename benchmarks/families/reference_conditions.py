"""Verdict on reference conditions: which mode sets of rod 1 give the results of the full rod, and at what cost."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.family import Family
from benchmarks.family import Record as Row
from benchmarks.page import Columns, csv_table, mean, png, table
from benchmarks.reference_conditions import claims, design, runs
from benchmarks.reference_conditions.claims import Rows, at, far_error
from benchmarks.reference_conditions.design import CONDITIONS, COUNT, COUNTS, FULL, MOST_COMPLETE, PLACES, RIGID
from flexclear.post.plotting.style import plt
from flexclear.post.plotting.table import pipe_table
from papers.wang_wang_2019.models import FAR_CB, FAR_FIXED, FAR_FREE

#: fraction of the compliance from which on a set is complete; error below which the mechanism's frequencies are right
COMPLETE, RESOLVED = 0.99, 0.01
SET: Columns = {"joint at": lambda r: f"{r['place_mm']} mm", "set": lambda r: design.label(r["condition"], r["count"])}
COST: Columns = {"evaluations": lambda r: str(r["evaluations"]), "seconds": lambda r: f"{r['seconds']:.2f}"}


def show(records: list[Row]) -> dict[str, str]:
    """Return the summary, the paper's statements, and the table of each group of rows that exists."""
    rows = {name: of for name in TABLES if (of := [r for r in records if r["case"] == name])}
    judged = {"claims": claims.judged(rows)} if "far" in rows and "clearance" in rows else {}
    return {"short": _short(rows)} | judged | {name: TABLES[name](rows) for name in rows}


def _short(rows: dict[str, list[Row]]) -> str:
    """Return which conditions are right in each respect, with the least whole count from COUNT on at every position."""
    lines = [f"With {COUNT} coordinates (or the next whole count), at all three places:\n"]
    if "statics" in rows:
        good = [c for c in CONDITIONS if _least(rows["statics"], c, COUNT) >= COMPLETE]
        lines.append(f"- static compliance complete to {100.0 * COMPLETE:g} %: {_or_none(good)};")
    if "frequencies" in rows:
        good = [c for c in CONDITIONS if _frequency_error(rows["frequencies"], c) < RESOLVED]
        lines.append(f"- first three frequencies of the mechanism within {100.0 * RESOLVED:g} %: {_or_none(good)};")
    if "far" in rows:
        good = [
            c
            for c in CONDITIONS
            if all(far_error(rows["far"], at(rows["far"], place, c, COUNT)) < claims.AGREE for place in PLACES)
        ]
        lines.append(f"- effects of the rod with ideal joints within {100.0 * claims.AGREE:g} %: {_or_none(good)};")
    if "clearance" in rows:
        good = [c for c in CONDITIONS if all(_peak_right(rows["clearance"], place, c) for place in PLACES)]
        lines.append(
            f"- peak contact force within {100.0 * claims.AGREE:g} % of the most complete set's, beyond what that is "
            f"unsettled by: {_or_none(good)}."
        )
        enough = _enough(rows["clearance"])
        if enough is not None:
            lines.append(f"    - Craig-Bampton is so from {enough} coordinates (or the next whole count) on;")
        lines += [f"    - at {place} mm: {_peaks(rows['clearance'], place)}." for place in PLACES]
    return "\n".join(lines) + "\n"


def _peak_error(rows: list[Row], place: int, condition: str, count: int = COUNT) -> float:
    best = claims.Rows([], [r for r in rows if r["place_mm"] == place]).best()["peak_force"]
    return float(abs(at(rows, place, condition, count)["peak_force"] / best - 1.0))


def _peak_right(rows: list[Row], place: int, condition: str) -> bool:
    return _peak_error(rows, place, condition) - _unsettled(rows, place) < claims.AGREE


def _unsettled(rows: list[Row], place: int) -> float:
    here = claims.Rows([], [r for r in rows if r["place_mm"] == place])
    fraction = claims.unsettled(here) / here.best()["peak_force"]
    return 0.0 if math.isnan(fraction) else fraction


def _enough(rows: list[Row]) -> int | None:
    """Return the least count from which on Craig-Bampton sets have the right peak force at every position, or None."""
    sets = [r for r in rows if r["condition"] == "craig-bampton"]
    most = min(max(r["count"] for r in sets if r["place_mm"] == place) for place in PLACES)
    known = [n for n in (COUNT, *MOST_COMPLETE) if n <= most]
    good = [all(_peak_error(rows, p, "craig-bampton", n) < claims.AGREE for p in PLACES) for n in known]
    return next((n for k, n in enumerate(known) if all(good[k:])), None)


def _peaks(rows: list[Row], place: int) -> str:
    errors = ", ".join(f"{c} {100.0 * _peak_error(rows, place, c):.1f} %" for c in CONDITIONS)
    settled = f"{100.0 * _unsettled(rows, place):.1f} %"
    return f"off by {errors}, the reference itself being settled to {settled}"


def _statics(rows: dict[str, list[Row]]) -> str:
    """Return fractions of the full rod's compliance, that compliance in the last line, and the complete sets."""
    found, body = rows["statics"], []
    for condition in CONDITIONS:
        for n in (7, COUNT, max(COUNTS)):
            near = [_nearest(found, place, condition, n) for place in PLACES]
            fractions = [" ".join(_share(r[d]) for d in ("z", "x", "rz")) for r in near]
            body.append([condition, "/".join(dict.fromkeys(str(r["count"]) for r in near)), *fractions])
    full = [", ".join(f"{at(found, place, FULL)[d]:.3g}" for d in ("z", "x", "rz")) for place in PLACES]
    head = ("condition", "coordinates", *(f"{place} mm" for place in PLACES))
    complete = [c for c in CONDITIONS if _least(found, c, COUNT) >= COMPLETE]
    never = [c for c in CONDITIONS if _least(found, c, max(COUNTS)) < 0.5]
    return (
        f"{pipe_table(head, [*body, [FULL, '', *full]])}\n\n"
        f"Complete (at least {100.0 * COMPLETE:g} % of each) with {COUNT} coordinates: {_or_none(complete)}. "
        f"Below half with {max(COUNTS)} coordinates at some place: {_or_none(never)}."
    )


def _nearest(rows: list[Row], place: int, condition: str, count: int) -> Row:
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition)]
    return max((r for r in of if r["count"] <= count + 1), key=lambda r: (r["count"] <= count, r["count"]))


def _least(rows: list[Row], condition: str, count: int) -> float:
    """Return the least fraction of the compliance over positions and directions."""
    near = [_nearest(rows, place, condition, count) for place in PLACES]
    return min(r[d] for r in near for d in ("z", "x", "rz"))


def _share(value: float) -> str:
    return f"{100.0 * value:.1f}" if value > 1e-9 else "0"


def _frequencies(rows: dict[str, list[Row]]) -> str:
    """Return the first vibrations of the mechanism, and the sets with which they are right."""
    found = _by_condition(rows["frequencies"])
    right = [c for c in CONDITIONS if _frequency_error(found, c) < RESOLVED]
    return (
        f"{table(found, VIBRATIONS)}\n\n"
        f"The first three within {100.0 * RESOLVED:g} % of the full rod's at every place and time: {_or_none(right)}."
    )


def _by_condition(rows: list[Row]) -> list[Row]:
    names = (FULL, *CONDITIONS)
    return sorted(rows, key=lambda r: (r["place_mm"], names.index(r["condition"]), r["time"]))


def _vibration(k: int) -> Callable[[Row], str]:
    return lambda r: f"{r['frequency'][k]:.1f}" if k < len(r["frequency"]) else "-"


#: the lowest six vibrations [Hz]
VIBRATIONS: Columns = {
    **SET,
    "time [s]": lambda r: f"{r['time']:g}",
    **{f"{k + 1}": _vibration(k) for k in range(6)},
}


def _frequency_error(rows: list[Row], condition: str) -> float:
    """Return the largest relative error of the first three frequencies; a set with fewer of them has error 1."""
    worst = 0.0
    for row in (r for r in rows if r["condition"] == condition):
        same = (row["place_mm"], FULL, row["time"])
        full = next(r for r in rows if (r["place_mm"], r["condition"], r["time"]) == same)["frequency"][:3]
        off = [abs(a / b - 1.0) for a, b in zip(row["frequency"], full, strict=False)]
        worst = max([worst, *off] if len(off) == len(full) else [1.0])
    return worst


def _far(rows: dict[str, list[Row]]) -> str:
    """Return effects of the rod and errors with ideal joints, of all sets."""
    return table(_far_rows(rows["far"]), _far_columns(rows["far"]))


def _far_rows(rows: list[Row]) -> list[Row]:
    return [r for r in sorted(rows, key=_order) if r["finer"] == 1 and r["condition"] != RIGID]


def _far_columns(rows: list[Row]) -> Columns:
    return {
        **SET,
        "angle [rad]": lambda r: f"{r['angle']:.2e}",
        "z [mm]": lambda r: f"{1e3 * r['displacement']:.2e}",
        "v [mm/s]": lambda r: f"{1e3 * r['velocity']:.3g}",
        "force [N]": lambda r: f"{r['force']:.2f}",
        "off by": lambda r: f"{100.0 * far_error(rows, r):.3g} %",
        "pointwise": lambda r: f"{100.0 * r['velocity_error']:.3g} %",
        **COST,
    }


CLEARANCE: Columns = {
    **SET,
    "members": lambda r: str(r["members"]),
    "peak force [N]": lambda r: mean(r, "peak_force"),
    "impacts": lambda r: mean(r, "impacts", digits=1),
    "angle [mrad]": lambda r: mean(r, "angle", 1e3, 3),
    "z [mm]": lambda r: mean(r, "displacement", 1e3, 4),
    "v [mm/s]": lambda r: mean(r, "velocity", 1e3, 2),
    "acceleration [m/s²]": lambda r: mean(r, "acceleration"),
    **COST,
}


def _clearance(rows: dict[str, list[Row]]) -> str:
    """Return means and spreads over the members with clearance, and why no ensemble has the complete basis."""
    more = f"{' and '.join(map(str, MOST_COMPLETE))} coordinates next to {COUNT} show what more would change."
    return f"{_why_not_all(rows)}{more}\n\n{table(sorted(rows['clearance'], key=_order), CLEARANCE)}"


def _why_not_all(rows: dict[str, list[Row]]) -> str:
    """Return the reason, with numbers, why no ensemble has the complete basis."""
    if "statics" not in rows or "far" not in rows:
        return ""
    highest = 1e-3 * at(rows["statics"], 0, FULL)["highest"]
    full, best = at(rows["far"], 0, FULL), at(rows["far"], 0, "craig-bampton", COUNT)
    return (
        f"The complete basis reaches up to {highest:.0f} kHz, a run with it takes "
        f"{full['seconds'] / best['seconds']:.0f} times that of {COUNT} Craig-Bampton coordinates, and with ideal "
        f"joints those are within {100.0 * far_error(rows['far'], best):.2g} % of it; it has no ensemble here. "
    )


def _mesh(rows: dict[str, list[Row]]) -> str:
    """Return the frequencies of coarser meshes against the finest, and the effect of the mesh on a run."""
    *coarse, finest = rows["mesh"]
    columns: Columns = {
        "elements": lambda r: str(r["elements"]),
        "largest error": lambda r: f"{100.0 * max(np.array(r['frequency']) / finest['frequency'] - 1.0):.4f} %",
    }
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


def _is_mesh_study(row: Row) -> bool:
    return (row["place_mm"], row["condition"], row["count"]) == (next(iter(PLACES)), "craig-bampton", COUNT)


def _order(row: Row) -> tuple[int, int, int]:
    names = (RIGID, *CONDITIONS, FULL)
    return row["place_mm"], names.index(row["condition"]), row["count"]


def _or_none(names: list[str]) -> str:
    return ", ".join(names) or "none"


#: group of rows -> function that returns its part of the page
TABLES = {
    "statics": _statics,
    "frequencies": _frequencies,
    "far": _far,
    "clearance": _clearance,
    "mesh": _mesh,
    "layouts": lambda rows: claims.of_layouts(rows["layouts"]),
}


#: colours of the paper's models where they have these modes, the others from the same palette
COLORS = dict(
    zip(design.CONDITIONS, (FAR_FREE.color, FAR_FIXED.color, "#56B4E9", "#CC79A7", FAR_CB.color), strict=True)
)
MARKERS = dict(zip(design.CONDITIONS, "osDv^", strict=True))
#: smaller relative errors are drawn at this value
FLOOR = 1e-7


def files(records: Sequence[Row]) -> dict[str, bytes]:
    """Return every figure, and the tables of claims and layouts, whose rows exist, by path below docs/."""
    of: dict[str, list[Row]] = {}
    for record in records:
        of.setdefault(record["case"], []).append(record)
    found = {f"{name}.png": png(draw(of[group]), dpi=110) for name, (group, draw) in FIGURES.items() if group in of}
    if "far" in of and "clearance" in of:
        found["claims.csv"] = csv_table(*claims.outcomes(of))
    if "layouts" in of:
        found["layouts.csv"] = csv_table(*claims.peaks(of["layouts"]))
    return {f"reference-conditions/{name}": content for name, content in found.items()}


def _draw_compliance(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(2, 3, figsize=(12, 6.4), sharex=True, sharey=True, layout="constrained")
    for column, place in enumerate(design.PLACES):
        for line, (direction, label) in enumerate((("x", "bending"), ("z", "axial"))):
            ax = axes[line, column]
            for condition in design.CONDITIONS:
                points = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition)]
                count, fraction = ([r[name] for r in points] for name in ("count", direction))
                ax.step(count, fraction, where="post", color=COLORS[condition], label=condition, linewidth=1.6)
            ax.set_title(f"{label}, joint at {place} mm", fontsize=10)
            ax.set_ylim(-0.03, 1.05)
            _plain(ax)
        axes[1, column].set_xlabel("coordinates")
    for ax in axes[:, 0]:
        ax.set_ylabel("share of the compliance")
    axes[0, 0].legend(fontsize=8, loc="center right")
    return figure


def _draw_frequencies(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), sharey=True, layout="constrained")
    for ax, place in zip(axes, design.PLACES, strict=True):
        here = [r for r in rows if r["place_mm"] == place and r["time"] == 0.0]
        full = np.array(next(r for r in here if r["condition"] == design.FULL)["frequency"])
        for condition in design.CONDITIONS:
            found = np.array(next(r for r in here if r["condition"] == condition)["frequency"])
            n = min(len(found), len(full))
            error = np.maximum(np.abs(found[:n] / full[:n] - 1.0), FLOOR)
            ax.semilogy(np.arange(1, n + 1), error, MARKERS[condition] + "-", color=COLORS[condition], label=condition)
        ax.set_title(f"joint at {place} mm", fontsize=10)
        ax.set_xlabel("vibration of the mechanism")
        _plain(ax)
    axes[0].set_ylabel("error of the frequency (share)")
    axes[0].legend(fontsize=8)
    return figure


def _draw_far(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.4), sharey=True, layout="constrained")
    first = next(iter(design.PLACES))
    for condition in design.CONDITIONS:
        of = [r for r in rows if r["condition"] == condition and r["finer"] == 1]
        line = sorted((r for r in of if r["place_mm"] == first), key=lambda r: r["count"])
        style = {"color": COLORS[condition], "marker": MARKERS[condition], "label": condition}
        axes[0].semilogy([r["count"] for r in line], [_off(r, rows) for r in line], **style)
        least = [at(of, place, condition, design.COUNT) for place in design.PLACES]
        axes[1].semilogy(list(design.PLACES), [_off(r, rows) for r in least], **style)
    axes[0].set_xlabel("coordinates (joint at 0 mm)")
    axes[1].set(xlabel="place of the prismatic joint (mm), least whole count from 13", xticks=list(design.PLACES))
    axes[0].set_ylabel("worst error of the largest effects,\nshare of the full rod's")
    axes[0].legend(fontsize=8)
    for ax in axes:
        _plain(ax)
    return figure


def _off(row: Row, rows: list[Row]) -> float:
    return max(FLOOR, far_error(rows, row))


def _draw_clearance(rows: list[Row]) -> Any:
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.4), sharey=True, layout="constrained")
    first = next(iter(design.PLACES))
    for k, condition in enumerate(design.CONDITIONS):
        of = [r for r in rows if r["condition"] == condition]
        least = [at(of, place, condition, design.COUNT) for place in design.PLACES]
        _bars(axes[0], [p + 2.5 * (k - 2) for p in design.PLACES], least, condition)
        line = sorted((r for r in of if r["place_mm"] == first), key=lambda r: r["count"])
        if len(line) > 1:
            _bars(axes[1], [r["count"] + 0.25 * (k - 2) for r in line], line, condition)
    for place in design.PLACES:
        rigid = next(r for r in rows if r["condition"] == design.RIGID and r["place_mm"] == place)["peak_force"]
        axes[0].plot([place - 8, place + 8], [rigid, rigid], color="#888888", label="rigid" if place == first else None)
        best = Rows([], [r for r in rows if r["place_mm"] == place]).best()
        dashed: dict[str, Any] = {"color": "#000000", "linestyle": "--", "linewidth": 1.0}
        words = f"craig-bampton, {best['count']} coordinates" if place == first else None
        axes[0].plot([place - 8, place + 8], [best["peak_force"]] * 2, label=words, **dashed)
    axes[0].set(xticks=list(design.PLACES), xlabel="place of the prismatic joint (mm), least whole count from 13")
    axes[1].set(xlabel="coordinates (joint at 0 mm)", xticks=sorted({*design.RUN_COUNTS, *design.MOST_COMPLETE}))
    axes[0].set_ylabel("peak contact force (N)")
    for ax in axes:
        if ax.get_legend_handles_labels()[0]:
            ax.legend(fontsize=7, loc="center left" if ax is axes[0] else "upper right")
        _plain(ax)
    return figure


def _bars(ax: Any, x: list[float], rows: list[Row], condition: str) -> None:
    peaks, spread = ([r[name] for r in rows] for name in ("peak_force", "peak_force_std"))
    style = {"color": COLORS[condition], "marker": MARKERS[condition], "linestyle": "none", "capsize": 3}
    ax.errorbar(x, peaks, yerr=spread, label=condition, **style)


def _plain(ax: Any) -> None:
    ax.grid(visible=True, color="#e3e3e3", linewidth=0.7)
    ax.tick_params(labelsize=8)


#: figure -> group of rows that it shows, and the function that draws it
FIGURES: dict[str, tuple[str, Callable[[list[Row]], Any]]] = {
    "compliance": ("statics", _draw_compliance),
    "frequencies": ("frequencies", _draw_frequencies),
    "far": ("far", _draw_far),
    "clearance": ("clearance", _draw_clearance),
}


FAMILY = Family(
    what="which mode sets of a rod give the answers of the full rod, and at what cost",
    takes="an hour on two cores",
    page="reference-conditions.md",
    cases=runs.cases,
    measure=runs.measure,
    show=show,
    # at 0 mm the sets of 13 coordinates or the next whole count; statements that depend on the layout
    rows=r"^\| 0 mm .*(full|rigid|\S 1[34] )(?!.* 0\.09 )|\| +(12|13|13/12) \||^\| full|\*\*(Holds|Does)|depends on",
    files=files,
    quick="mesh",
    settings={"members": 8},
    times=False,
)
