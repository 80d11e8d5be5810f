"""The paper's statements about mode sets, each with a rule, a threshold and its outcome at each position.

Source of the statements: Wang & Wang (2019), secs. 6 and 7, Tables 7 to 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.families.geometry import JOINTS
from benchmarks.family import Record as Row
from benchmarks.page import Columns, mean
from benchmarks.reference_conditions.design import FULL, PLACES, RIGID
from flexclear.post.plotting.table import pipe_table

#: two results agree, or one is right, when they differ by less than this fraction of the effect in question
AGREE = 0.1
#: an effect is small relative to another one below this fraction
SMALL = 0.01
#: two ensembles differ when their means differ by more than this multiple of the larger standard deviation
DIFFER = 2.0
#: FAR costs as much as ideal up to this factor (the paper: 1.15 to 1.21), FAR-CSJ as twice CSJ likewise
COST = 1.5
#: smaller fractions are printed as "under" this value
SHOWN = 1e-4
#: largest deviations from the ideal mechanism: of the platform's angle, height and velocity, of the force at A1
EFFECTS = ("angle", "displacement", "velocity", "force")


@dataclass(frozen=True)
class Claim:
    """A statement of the paper.  test: returns, for the rows at one position, the outcome and its numbers in words."""

    paper: str
    rule: str
    test: Callable[[Rows], tuple[bool, str]]


@dataclass(frozen=True)
class Rows:
    """Rows of one position of the joint: with ideal joints, with clearance."""

    far: list[Row]
    clearance: list[Row]

    def free(self, group: str = "far") -> Row:
        """Return the free-free set with the fewest coordinates, the paper's choice as far as it is printed."""
        return self._fewest(group, "free-free")

    def fixed(self, group: str = "far") -> Row:
        """Return the fixed-fixed set with the fewest coordinates."""
        return self._fewest(group, "fixed-fixed")

    def named(self, group: str, condition: str) -> Row:
        """Return the one row of a condition without a count."""
        return next(row for row in getattr(self, group) if row["condition"] == condition)

    def best(self) -> Row:
        """Return the most complete Craig-Bampton set with clearance."""
        return max((r for r in self.clearance if r["condition"] == "craig-bampton"), key=lambda r: r["count"])

    def _fewest(self, group: str, condition: str) -> Row:
        return min((r for r in getattr(self, group) if r["condition"] == condition), key=lambda r: r["count"])


def at(rows: list[Row], place: int, condition: str, count: int = 0) -> Row:
    """Return the row of a condition at a position with the least count that is not below `count`."""
    of = [r for r in rows if (r["place_mm"], r["condition"]) == (place, condition) and r.get("finer", 1) == 1]
    return min((r for r in of if r["count"] >= count), key=lambda r: r["count"])


def off(row: Row, full: Row) -> dict[str, float]:
    """Return the differences of a mode set's largest effects from the full rod's, as fractions of the latter."""
    return {name: abs(row[name] / full[name] - 1.0) for name in EFFECTS}


def far_error(rows: list[Row], row: Row) -> float:
    """Return the worst error of a set's largest effects, as a fraction of the full rod's."""
    return max(off(row, at(rows, row["place_mm"], FULL)).values())


def verdicts(groups: dict[str, list[Row]]) -> list[tuple[Claim, dict[int, tuple[bool, str]]]]:
    """Return every claim with its outcome at each position [mm]."""
    found = []
    for claim in CLAIMS:
        found.append((claim, {place: claim.test(numbers_of(groups, place)) for place in PLACES}))
    return found


def numbers_of(groups: dict[str, list[Row]], place: int) -> Rows:
    """Return the rows at one position [mm] of the prismatic joint, on the paper's mesh."""
    far, clearance = (
        [r for r in groups[name] if r["place_mm"] == place and r["finer"] == 1] for name in ("far", "clearance")
    )
    return Rows(far, clearance)


def judged(groups: dict[str, list[Row]]) -> str:
    """Return a table of every claim with its outcome."""
    return pipe_table(
        ("statement", "here"), [(claim.paper, sentence(outcomes)) for claim, outcomes in verdicts(groups)]
    )


def outcomes(groups: dict[str, list[Row]]) -> tuple[list[Row], Columns]:
    """Return the rows and the columns of a table of all outcomes, with the rules and the numbers of every position."""
    lines = [
        {
            "statement": claim.paper,
            "joint at [mm]": place,
            "holds": "yes" if good else "no",
            "numbers": numbers,
            "rule": claim.rule,
        }
        for claim, found in verdicts(groups)
        for place, (good, numbers) in found.items()
    ]
    return lines, {name: partial(_cell, name) for name in lines[0]}


def _cell(name: str, line: Row) -> str:
    return str(line[name])


def sentence(outcomes: dict[int, tuple[bool, str]]) -> str:
    """Return in words where a claim holds."""
    holds = [place for place, (good, _) in outcomes.items() if good]
    fails = [place for place in outcomes if place not in holds]
    if not fails:
        return "**Holds** at all three places."
    if not holds:
        return "**Does not hold** at any of the three places."
    return f"**Holds at {_listed(holds)}, not at {_listed(fails)}.**"


def _listed(places: list[int]) -> str:
    return " and ".join(f"{place} mm" for place in places)


def _consistent(rows: Rows) -> tuple[bool, str]:
    full = rows.named("far", FULL)
    difference = {name: abs(rows.free()[name] - rows.fixed()[name]) / full[name] for name in EFFECTS}
    worst = max(difference, key=lambda n: difference[n])
    found = [_percent(row["velocity"] / full["velocity"]) for row in (rows.free(), rows.fixed())]
    return difference[worst] < AGREE, (
        f"they differ by {_percent(difference[worst])} of the full rod's effect ({worst}); of its effect on the "
        f"velocity they find {found[0]} (free-free) and {found[1]} (fixed-fixed)"
    )


def _right(which: str) -> Callable[[Rows], tuple[bool, str]]:
    def test(rows: Rows) -> tuple[bool, str]:
        found = off(getattr(rows, which)(), rows.named("far", FULL))
        return max(found.values()) < AGREE, "off by " + ", ".join(f"{_percent(s)} ({n})" for n, s in found.items())

    return test


def _dominates(rows: Rows) -> tuple[bool, str]:
    far, csj = rows.named("far", FULL), rows.named("clearance", RIGID)
    fraction = {name: far[name] / csj[name] for name in ("angle", "displacement", "velocity")}
    return max(fraction["angle"], fraction["displacement"]) < SMALL, ", ".join(
        f"{n} {_percent(s)}" for n, s in fraction.items()
    )


def _insensitive(rows: Rows) -> tuple[bool, str]:
    free, fixed = rows.free("clearance"), rows.fixed("clearance")
    difference = {name: abs(free[name] - fixed[name]) / fixed[name] for name in ("angle", "displacement", "velocity")}
    return max(difference.values()) < AGREE, ", ".join(f"{name} {_percent(a)}" for name, a in difference.items())


def _sensitive(rows: Rows) -> tuple[bool, str]:
    free, fixed = rows.free("clearance"), rows.fixed("clearance")
    good = all(_differ(free, fixed, name) for name in ("peak_force", "acceleration"))
    return good, (
        f"peak force {mean(free, 'peak_force')} N and {mean(fixed, 'peak_force')} N, "
        f"acceleration {mean(free, 'acceleration')} m/s² and {mean(fixed, 'acceleration')} m/s²"
    )


def _differ(a: Row, b: Row, name: str) -> bool:
    difference, spread = abs(a[name] - b[name]), max(a[f"{name}_std"], b[f"{name}_std"])
    return bool(difference > AGREE * abs(b[name]) and difference > DIFFER * spread)


def _fixed_is_right(rows: Rows) -> tuple[bool, str]:
    best = rows.best()
    off_by = {w: getattr(rows, w)("clearance")["peak_force"] - best["peak_force"] for w in ("free", "fixed")}
    return abs(off_by["fixed"]) < abs(off_by["free"]), (
        f"peak force off by {off_by['free']:+.0f} N (free-free) and {off_by['fixed']:+.0f} N (fixed-fixed) of "
        f"{mean(best, 'peak_force')} N, which itself changed by {unsettled(rows):.0f} N with the last coordinates"
    )


def unsettled(rows: Rows) -> float:
    """Return the change of the mean peak force [N] from the second most to the most complete Craig-Bampton set."""
    line = sorted((r for r in rows.clearance if r["condition"] == "craig-bampton"), key=lambda r: r["count"])
    return float(abs(line[-1]["peak_force"] - line[-2]["peak_force"])) if len(line) > 1 else float("nan")


def _softens(rows: Rows) -> tuple[bool, str]:
    best, rigid = rows.best(), rows.named("clearance", RIGID)
    fall = 1.0 - best["peak_force"] / rigid["peak_force"]
    return fall > AGREE, f"peak force {rigid['peak_force']:.0f} N rigid, {mean(best, 'peak_force')} N flexible"


def _enlarges(rows: Rows) -> tuple[bool, str]:
    best, rigid = rows.best(), rows.named("clearance", RIGID)
    rise = {name: best[name] / rigid[name] - 1.0 for name in ("angle", "displacement", "velocity")}
    return min(rise.values()) > 0.0, ", ".join(f"{name} {100.0 * r:+.1f} %" for name, r in rise.items())


def _cheap(rows: Rows) -> tuple[bool, str]:
    ratio = rows.free()["evaluations"] / rows.named("far", RIGID)["evaluations"]
    return ratio < COST, f"{ratio:.0f} times the ideal model's evaluations (free-free)"


def _twice(rows: Rows) -> tuple[bool, str]:
    ratio = rows.free("clearance")["evaluations"] / rows.named("clearance", RIGID)["evaluations"]
    return 2.0 / COST < ratio < 2.0 * COST, f"{ratio:.1f} times the rigid model's evaluations (free-free)"


def _percent(fraction: float) -> str:
    if not np.isfinite(fraction):
        return "-"
    return f"{100.0 * fraction:.3g} %" if fraction >= SHOWN else f"under {100.0 * SHOWN:g} %"


CLAIMS = (
    Claim(
        "With ideal joints, free-free and fixed-fixed modes give consistent answers (Table 7).",
        f"The effects of the rod's flexibility differ by less than {100.0 * AGREE:g} % of that of the full rod.",
        _consistent,
    ),
    Claim(
        "With ideal joints, free-free modes are suitable.",
        f"Largest effects on angle, height, velocity and force at A1 are within {100.0 * AGREE:g} % of the full rod's.",
        _right("free"),
    ),
    Claim("With ideal joints, so are fixed-fixed modes.", "The same.", _right("fixed")),
    Claim(
        "Next to clearance, the rod's flexibility hardly moves the platform (Tables 7 and 8).",
        f"Angle and displacement change by less than {100.0 * SMALL:g} % of what clearance does to them.",
        _dominates,
    ),
    Claim(
        "With clearance, angle, displacement and velocity do not depend on the mode set (Table 9).",
        f"Mean deviations from ideal with free-free and fixed-fixed modes differ by less than {100.0 * AGREE:g} %.",
        _insensitive,
    ),
    Claim(
        "With clearance, contact force and acceleration do depend on it.",
        f"Means differ by more than {100.0 * AGREE:g} %, and than {DIFFER:g} standard deviations of the members.",
        _sensitive,
    ),
    Claim(
        "The reference condition to impose is fixed-fixed.",
        "With clearance its peak force is nearer to that of the most complete Craig-Bampton set than free-free's.",
        _fixed_is_right,
    ),
    Claim(
        "The flexible rod softens the impacts.",
        f"The peak force of the most complete set is below that of the rigid rod by more than {100.0 * AGREE:g} %.",
        _softens,
    ),
    Claim(
        "Flexibility and clearance together deviate more from ideal than clearance alone (Tables 8 and 9).",
        "Mean deviations of angle, displacement and velocity are all larger with the most complete set.",
        _enlarges,
    ),
    Claim(
        "A flexible rod with ideal joints costs hardly more than the ideal model (Table 10: 1.15 to 1.21).",
        f"Less than {COST:g} times its evaluations, of which each costs more.",
        _cheap,
    ),
    Claim(
        "A flexible rod doubles the cost of a model with clearance (Table 10: 39.7 against 20).",
        f"Between {2.0 / COST:.2g} and {2.0 * COST:.2g} times its evaluations, of which each costs more.",
        _twice,
    ),
)


PLACE = ("layout", "ax", "ay", "bx", "by", "height")
LAYOUT: Columns = {"layout": lambda r: "first" if r.get("first") else str(r["layout"]), **JOINTS}


def rows_of(rows: list[Row], layout: int) -> Rows:
    """Return the rows of one layout; with ideal joints the most complete set represents the full rod."""
    here = [r for r in rows if r["layout"] == layout]
    far, clearance = ([r for r in here if r["clearance"] == which] for which in (False, True))
    most = max((r for r in far if r["condition"] == "craig-bampton"), key=lambda r: r["count"])
    return Rows([*far, most | {"condition": FULL}], clearance)


def layout_verdicts(rows: list[Row]) -> list[tuple[Claim, dict[int, tuple[bool, str]]]]:
    """Return every claim with its outcome for each layout."""
    of = {layout: rows_of(rows, layout) for layout in sorted({r["layout"] for r in rows})}
    return [(claim, {layout: claim.test(here) for layout, here in of.items()}) for claim in CLAIMS]


def of_layouts(rows: list[Row]) -> str:
    """Return the number of identified layouts for which each statement holds, and the overall verdict.

    Rows marked `first` belong to the layout that was assumed earlier; its outcome has a column of its own.
    """
    identified = [row for row in rows if not row.get("first")]
    before = layout_verdicts([row for row in rows if row.get("first")])
    judged = []
    for (claim, outcomes), (_, assumed) in zip(layout_verdicts(identified), before, strict=True):
        good = sum(holds for holds, _ in outcomes.values())
        own = next((holds for holds, _ in assumed.values()), None)
        judged.append([claim.paper, _yes(own), f"{good} of {len(outcomes)}", _verdict(good, len(outcomes), own)])
    head = ("statement", "first layout", "identified layouts", "over all of them")
    return pipe_table(head, judged)


def _yes(holds: bool | None) -> str:
    return "–" if holds is None else ("holds" if holds else "does not hold")


def _verdict(good: int, of: int, own: bool | None) -> str:
    if good == of and own is not False:
        return "**holds**"
    if good == 0 and own is not True:
        return "**does not hold**"
    return "depends on the layout"


def peaks(rows: list[Row]) -> tuple[list[Row], Columns]:
    """Return the rows and the columns of a table of the peak contact forces of each layout."""
    layouts = sorted({r["layout"] for r in rows})

    def peak(condition: str, count: int | None) -> dict[int, Row]:
        return {
            r["layout"]: r
            for r in rows
            if r["clearance"] and r["condition"] == condition and (count is None or r["count"] == count)
        }

    counts = sorted({r["count"] for r in rows if r["condition"] == "craig-bampton"})
    sets = [(RIGID, None), ("free-free", None), ("fixed-fixed", None), *(("craig-bampton", n) for n in counts)]
    lines = []
    for layout in layouts:
        found = [peak(*which)[layout] for which in sets]
        place = {name: found[0][name] for name in PLACE} | ({"first": True} if found[0].get("first") else {})
        lines.append(place | {f"{w[0]} {r['count'] or ''}".strip(): r for w, r in zip(sets, found, strict=True)})
    forces: Columns = {f"{name} [N]": partial(_peak, name) for name in lines[0] if name not in (*PLACE, "first")}
    return lines, {**LAYOUT, **forces}


def _peak(name: str, line: Row) -> str:
    return mean(line[name], "peak_force")
