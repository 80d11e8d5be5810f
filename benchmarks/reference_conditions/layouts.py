"""The paper's statements over layouts of the mechanism: what holds for every one of them does not hang on the layout.

The paper prints no joint coordinates; `benchmarks.geometry` finds the layouts that have the sensitivities of Table 8.
"""

from __future__ import annotations

from functools import partial

from benchmarks.families.geometry import JOINTS
from benchmarks.family import Record as Row
from benchmarks.page import Columns, table
from benchmarks.reference_conditions.claims import CLAIMS, Claim, Rows
from benchmarks.reference_conditions.design import FULL, RIGID
from flexclear.pipeline.post.plotting.table import pipe_table

PLACE = ("layout", "ax", "ay", "bx", "by", "height")
LAYOUT: Columns = {"layout": lambda r: "first" if r.get("first") else str(r["layout"]), **JOINTS}


def rows_of(rows: list[Row], layout: int) -> Rows:
    """Rows of one layout; with ideal joints the most complete set represents the full rod."""
    here = [r for r in rows if r["layout"] == layout]
    far, clearance = ([r for r in here if r["clearance"] == which] for which in (False, True))
    most = max((r for r in far if r["condition"] == "craig-bampton"), key=lambda r: r["count"])
    return Rows([*far, most | {"condition": FULL}], clearance)


def verdicts(rows: list[Row]) -> list[tuple[Claim, dict[int, tuple[bool, str]]]]:
    """Every claim with its outcome for each layout."""
    of = {layout: rows_of(rows, layout) for layout in sorted({r["layout"] for r in rows})}
    return [(claim, {layout: claim.test(here) for layout, here in of.items()}) for claim in CLAIMS]


def text(rows: list[Row]) -> str:
    """How many identified layouts each statement holds for, what that says of it, and the numbers behind it.

    Rows that say `first` are those of the layout that was assumed before, whose verdict is next to it.
    """
    identified = [row for row in rows if not row.get("first")]
    before = verdicts([row for row in rows if row.get("first")])
    judged = []
    for (claim, outcomes), (_, assumed) in zip(verdicts(identified), before, strict=True):
        good = sum(holds for holds, _ in outcomes.values())
        own = next((holds for holds, _ in assumed.values()), None)
        judged.append([claim.paper, _yes(own), f"{good} of {len(outcomes)}", _verdict(good, len(outcomes), own)])
    head = ("statement", "first layout", "identified layouts", "over all of them")
    examples = "\n".join(_numbers(claim, outcomes) for claim, outcomes in verdicts(identified))
    shown = "Of each statement one layout for which it holds, and one for which it does not:"
    return f"{pipe_table(head, judged)}\n\n{_peaks(rows)}\n\n{shown}\n\n{examples}"


def _yes(holds: bool | None) -> str:
    return "–" if holds is None else ("holds" if holds else "does not hold")


def _verdict(good: int, of: int, own: bool | None) -> str:
    if good == of and own is not False:
        return "**holds**"
    if good == 0 and own is not True:
        return "**does not hold**"
    return "hangs on the layout"


def _numbers(claim: Claim, outcomes: dict[int, tuple[bool, str]]) -> str:
    """The first and last outcome of either kind: what is typical of those that hold and of those that do not."""
    lines = [f"- {claim.paper}"]
    for holds in (True, False):
        of = {layout: numbers for layout, (good, numbers) in outcomes.items() if good == holds}
        if of:
            layout, numbers = next(iter(of.items()))
            lines.append(f"  - {'holds' if holds else 'does not hold'}, as for layout {layout}: {numbers}")
    return "\n".join(lines)


def _peaks(rows: list[Row]) -> str:
    """Peak contact forces of each layout."""
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
    peaks: Columns = {f"{name} [N]": partial(_peak, name) for name in lines[0] if name not in (*PLACE, "first")}
    return "Peak contact forces:\n\n" + table(lines, {**LAYOUT, **peaks})


def _peak(name: str, line: Row) -> str:
    row = line[name]
    mean = f"{row['peak_force']:.0f}"
    return mean if row["members"] == 1 else f"{mean} ± {row['peak_force_std']:.0f}"
