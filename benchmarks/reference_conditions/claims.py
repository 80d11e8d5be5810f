"""The paper's statements about mode sets, each with a number, a threshold, and whether it holds at each place.

Source of the statements: Wang & Wang (2019), secs. 6 and 7, Tables 7 to 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.reference_conditions.design import FULL, PLACES, RIGID

Row = dict[str, Any]
#: two answers agree, or one is right, when they differ by less than this share of the effect in question
AGREE = 0.1
#: an effect is small beside another below this share of it
SMALL = 0.01
#: two ensembles differ when their means do by more than this many times the larger of their standard deviations
DIFFER = 2.0
#: FAR costs as much as ideal up to this factor (the paper: 1.15 to 1.21), FAR-CSJ twice CSJ within this factor of two
COST = 1.5


@dataclass(frozen=True)
class Claim:
    """A statement. test: of the rows at one place, whether it holds and the numbers that say so, in words."""

    paper: str
    rule: str
    test: Callable[[Rows], tuple[bool, str]]


@dataclass(frozen=True)
class Rows:
    """Rows of one place: ideal joints, clearance."""

    far: list[Row]
    clearance: list[Row]

    def free(self, group: str = "far") -> Row:
        """Free-free set with the fewest coordinates, the paper's choice as far as it prints it."""
        return self._fewest(group, "free-free")

    def fixed(self, group: str = "far") -> Row:
        """Fixed-fixed set likewise."""
        return self._fewest(group, "fixed-fixed")

    def named(self, group: str, condition: str) -> Row:
        """The one row of a condition without a count."""
        return next(row for row in getattr(self, group) if row["condition"] == condition)

    def best(self) -> Row:
        """The most complete Craig-Bampton set with clearance."""
        return max((r for r in self.clearance if r["condition"] == "craig-bampton"), key=lambda r: r["count"])

    def _fewest(self, group: str, condition: str) -> Row:
        return min((r for r in getattr(self, group) if r["condition"] == condition), key=lambda r: r["count"])


def verdicts(groups: dict[str, list[Row]]) -> list[tuple[Claim, dict[int, tuple[bool, str]]]]:
    """Every claim with its outcome at each place [mm]."""
    found = []
    for claim in CLAIMS:
        at = {}
        for place in PLACES:
            far, clearance = (
                [r for r in groups[name] if r["place_mm"] == place and r["finer"] == 1] for name in ("far", "clearance")
            )
            at[place] = claim.test(Rows(far, clearance))
        found.append((claim, at))
    return found


def sentence(outcomes: dict[int, tuple[bool, str]]) -> str:
    """Where a claim holds, in words."""
    holds = [place for place, (good, _) in outcomes.items() if good]
    fails = [place for place in outcomes if place not in holds]
    if not fails:
        return "**Holds** at all three places."
    if not holds:
        return "**Does not hold** at any of the three places."
    return f"**Holds at {_listed(holds)}, not at {_listed(fails)}.**"


def _listed(places: list[int]) -> str:
    return " and ".join(f"{place} mm" for place in places)


def _alike(rows: Rows) -> tuple[bool, str]:
    full = rows.named("far", FULL)
    apart = {n: abs(rows.free()[n] - rows.fixed()[n]) / full[n] for n in ("angle", "displacement", "velocity", "force")}
    worst = max(apart, key=lambda n: apart[n])
    return apart[worst] < AGREE, f"they differ by {_percent(apart[worst])} of the full rod's effect ({worst})"


def _suited(which: str) -> Callable[[Rows], tuple[bool, str]]:
    def test(rows: Rows) -> tuple[bool, str]:
        row = getattr(rows, which)()
        return max(row["velocity_error"], row["force_error"]) < AGREE, (
            f"off by {_percent(row['velocity_error'])} (velocity) and {_percent(row['force_error'])} (force at A1)"
        )

    return test


def _dominates(rows: Rows) -> tuple[bool, str]:
    far, csj = rows.named("far", FULL), rows.named("clearance", RIGID)
    share = {name: far[name] / csj[name] for name in ("angle", "displacement", "velocity")}
    return max(share["angle"], share["displacement"]) < SMALL, ", ".join(f"{n} {_percent(s)}" for n, s in share.items())


def _insensitive(rows: Rows) -> tuple[bool, str]:
    free, fixed = rows.free("clearance"), rows.fixed("clearance")
    apart = {name: abs(free[name] - fixed[name]) / fixed[name] for name in ("angle", "displacement", "velocity")}
    return max(apart.values()) < AGREE, ", ".join(f"{name} {_percent(a)}" for name, a in apart.items())


def _apart(rows: Rows) -> tuple[bool, str]:
    free, fixed = rows.free("clearance"), rows.fixed("clearance")
    size = {
        n: abs(free[n] - fixed[n]) / max(free[f"{n}_std"], fixed[f"{n}_std"]) for n in ("peak_force", "acceleration")
    }
    return size["peak_force"] > DIFFER, (
        f"peak force {_mean(free, 'peak_force')} N and {_mean(fixed, 'peak_force')} N, "
        f"{size['peak_force']:.1f} standard deviations; acceleration {size['acceleration']:.1f}"
    )


def _fixed_is_right(rows: Rows) -> tuple[bool, str]:
    best = rows.best()
    off = {w: getattr(rows, w)("clearance")["peak_force"] - best["peak_force"] for w in ("free", "fixed")}
    shown = f"peak force off by {off['free']:+.0f} N (free-free) and {off['fixed']:+.0f} N (fixed-fixed) of "
    return abs(off["fixed"]) < abs(off["free"]), shown + f"{_mean(best, 'peak_force')} N"


def _softens(rows: Rows) -> tuple[bool, str]:
    best, rigid = rows.best(), rows.named("clearance", RIGID)
    fall = 1.0 - best["peak_force"] / rigid["peak_force"]
    return fall > AGREE, f"peak force {rigid['peak_force']:.0f} N rigid, {_mean(best, 'peak_force')} N flexible"


def _enlarges(rows: Rows) -> tuple[bool, str]:
    best, rigid = rows.best(), rows.named("clearance", RIGID)
    rise = {name: best[name] / rigid[name] - 1.0 for name in ("angle", "displacement", "velocity")}
    return min(rise.values()) > 0.0, ", ".join(f"{name} {100.0 * r:+.1f} %" for name, r in rise.items())


def _cheap(rows: Rows) -> tuple[bool, str]:
    ratio = rows.free()["seconds"] / rows.named("far", RIGID)["seconds"]
    return ratio < COST, f"{ratio:.1f} times the ideal model's time (free-free)"


def _twice(rows: Rows) -> tuple[bool, str]:
    ratio = rows.free("clearance")["seconds"] / rows.named("clearance", RIGID)["seconds"]
    return 2.0 / COST < ratio < 2.0 * COST, f"{ratio:.1f} times the rigid model's time (free-free)"


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if np.isfinite(share) else "-"


def _mean(row: Row, name: str) -> str:
    return f"{row[name]:.0f} ± {row[f'{name}_std']:.0f}"


CLAIMS = (
    Claim(
        "With ideal joints, free-free and fixed-fixed modes give consistent answers (Table 7).",
        f"The effects of the rod's flexibility differ by less than {100.0 * AGREE:g} % of that of the full rod.",
        _alike,
    ),
    Claim(
        "With ideal joints, free-free modes are suitable.",
        f"Velocity of the platform and force at A1 are within {100.0 * AGREE:g} % of the full rod's effect.",
        _suited("free"),
    ),
    Claim("With ideal joints, so are fixed-fixed modes.", "The same.", _suited("fixed")),
    Claim(
        "Beside clearance, the rod's flexibility hardly moves the platform (Tables 7 and 8).",
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
        f"Mean peak forces differ by more than {DIFFER:g} standard deviations of the members.",
        _apart,
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
        f"Less than {COST:g} times its processor time.",
        _cheap,
    ),
    Claim(
        "A flexible rod doubles the cost of a model with clearance (Table 10: 39.7 against 20).",
        f"Between {2.0 / COST:.2g} and {2.0 * COST:.2g} times its processor time.",
        _twice,
    ),
)
