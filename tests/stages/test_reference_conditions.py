"""The verdict page says what its numbers say: every statement turns when its numbers do."""

from __future__ import annotations

import pytest

from benchmarks.families import reference_conditions
from benchmarks.family import Record as Row
from benchmarks.layouts import Layout
from benchmarks.reference_conditions import claims, design
from benchmarks.reference_conditions.design import CONDITIONS, COUNT, FULL, MOST_COMPLETE, PLACES, RIGID, Case

EFFECT = {"angle": 3e-6, "displacement": 3e-7, "velocity": 7e-4}


def far_row(place: int, condition: str, count: int) -> Row:
    row = {"place_mm": place, "condition": condition, "count": count, "finer": 1, "force": 10.0, "evaluations": 9000}
    return row | EFFECT | {"velocity_error": 0.01, "force_error": 0.02, "seconds": 1.2}


def clearance_row(place: int, condition: str, count: int, peak: float) -> Row:
    mean = {
        "angle": 1.6e-3,
        "displacement": 2e-4,
        "velocity": 15e-3,
        "acceleration": 800.0 * peak / 1500.0,
        "impacts": 25.0,
    }
    row = {"place_mm": place, "condition": condition, "count": count, "finer": 1, "members": 16, "evaluations": 90000}
    row |= mean | {"peak_force": peak} | {f"{name}_std": 0.01 * value for name, value in mean.items()}
    return row | {"peak_force_std": 20.0, "seconds": 2.0}


def rows() -> dict[str, list[Row]]:
    """Numbers under which every statement holds: fixed-fixed right, free-free off with clearance only."""
    far, clearance = [], []
    for place in PLACES:
        far += [far_row(place, condition, 13) for condition in CONDITIONS] + [far_row(place, FULL, 0)]
        far.append(far_row(place, RIGID, 0) | dict.fromkeys(EFFECT, 0.0) | {"evaluations": 7500})
        peaks = dict.fromkeys(CONDITIONS, 1500.0) | {"free-free": 1700.0}
        clearance += [clearance_row(place, condition, 13, peak) for condition, peak in peaks.items()]
        clearance.append(clearance_row(place, RIGID, 0, 2600.0) | {"evaluations": 45000, "members": 1})
        for name in EFFECT:
            clearance[-1][name] *= 0.99
    return {"far": far, "clearance": clearance}


def outcome(groups: dict[str, list[Row]], words: str) -> str:
    return next(claims.sentence(at) for claim, at in claims.verdicts(groups) if words in claim.paper)


def changed(group: str, place: int, condition: str, **values: float) -> dict[str, list[Row]]:
    groups = rows()
    groups[group] = [
        row | values if (row["place_mm"], row["condition"]) == (place, condition) else row for row in groups[group]
    ]
    return groups


def test_all_statements_can_hold() -> None:
    assert {claims.sentence(at) for _, at in claims.verdicts(rows())} == {"**Holds** at all three places."}


@pytest.mark.parametrize(
    "words, group, condition, values",
    [
        ("give consistent answers", "far", "fixed-fixed", {"displacement": 0.8 * EFFECT["displacement"]}),
        ("free-free modes are suitable", "far", "free-free", {"force": 8.9}),
        ("so are fixed-fixed modes", "far", "fixed-fixed", {"velocity": 0.0}),
        ("hardly moves the platform", "far", FULL, {"displacement": 3e-6}),
        ("do not depend on the mode set", "clearance", "free-free", {"velocity": 17e-3}),
        ("do depend on it", "clearance", "free-free", {"peak_force": 1539.0}),
        ("to impose is fixed-fixed", "clearance", "fixed-fixed", {"peak_force": 1900.0}),
        ("softens the impacts", "clearance", "craig-bampton", {"peak_force": 2500.0}),
        ("together deviate more", "clearance", "craig-bampton", {"velocity": 14e-3}),
        ("costs hardly more", "far", "free-free", {"evaluations": 12000}),
        ("doubles the cost", "clearance", "free-free", {"evaluations": 180000}),
    ],
)
def test_each_statement_turns_with_its_numbers(
    words: str, group: str, condition: str, values: dict[str, float]
) -> None:
    at_60 = changed(group, 60, condition, **values)
    assert outcome(at_60, words) == "**Holds at 0 mm and 120 mm, not at 60 mm.**"


def test_the_page_has_a_part_and_a_figure_per_group() -> None:
    records = [{"case": group, **row} for group, of in rows().items() for row in of]
    parts = reference_conditions.FAMILY.show(records)
    assert isinstance(parts, dict)
    assert parts.keys() == {"short", "claims", "far", "clearance"}
    assert "**Holds** at all three places." in parts["claims"]
    found = reference_conditions.files(records).keys()
    names = ("claims.csv", "far.png", "clearance.png")
    assert found == {f"reference-conditions/{name}" for name in names}


def test_cases_take_the_scene_of_their_place() -> None:
    for place, frame in PLACES.items():
        scene = design.scene(Case(place, "craig-bampton", 13, clearance=True, members=3))
        assert scene.joint["P1"].between[1] == f"rod1.{frame}"
        assert scene.contacts().keys() == {"A1"}
        assert scene.ensemble is not None
        assert scene.ensemble.members == 3
        assert scene.flexible()["rod1"].modes.interfaces == (frame, "top")
    assert design.scene(Case(0, RIGID)).flexible() == {}


def test_ensembles_of_dear_sets_have_half_the_members(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(design, "whole", lambda place, condition, count: count)
    cases = design.clearance(8)
    assert len(set(cases)) == len(cases)
    assert {case.members for case in cases if case.condition == RIGID} == {0}
    assert {case.members for case in cases if case.condition != RIGID and case.count <= COUNT} == {8}
    assert {case.members for case in cases if case.count > COUNT} == {4}
    for place in PLACES:
        sets = {case.count for case in cases if (case.place, case.condition) == (place, "craig-bampton")}
        assert sets >= {COUNT, *MOST_COMPLETE}


def layout_rows(layouts: int, **odd: float) -> list[Row]:
    """The numbers under which every statement holds for some layouts and for the first one, which comes last.

    The rigid rod of the last identified one differs by `odd`.
    """
    found = []
    for layout in range(layouts + 1):
        where = {"layout": layout, "ax": 0.12, "ay": 0.04, "bx": 0.2, "by": 0.3, "height": 0.22}
        where |= {"first": True} if layout == layouts else {}
        for group, of in rows().items():
            for row in (r for r in of if r["place_mm"] == 0 and r["condition"] != FULL):
                values = odd if layout == layouts - 1 and row["condition"] == RIGID and group == "clearance" else {}
                found.append(where | row | values | {"clearance": group == "clearance"})
    return found


def test_a_statement_holds_of_the_paper_when_it_holds_for_every_layout() -> None:
    every = claims.of_layouts(layout_rows(3))
    assert "| holds | 3 of 3 | **holds** |" in " ".join(every.split())
    assert "depends on the layout" not in every
    # a rigid rod whose impacts are as soft: the flexible one softens nothing there
    some = " ".join(claims.of_layouts(layout_rows(3, peak_force=1500.0)).split())
    assert "| The flexible rod softens the impacts. | holds | 2 of 3 | depends on the layout |" in some


def test_cases_of_a_layout_have_its_places_and_no_other() -> None:
    layout = Layout(0.12, 0.04, 0.2, 0.3, 0.22)
    cases = design.of_layout(layout, 8)
    assert {case.members for case in cases if case.clearance and case.count == COUNT and case.condition != RIGID} == {4}
    for case in (cases[0], cases[-1]):
        scene = design.scene(case)
        assert scene.body["platform"].pose.position == (0.0, 0.0, 0.22)
        assert scene.body["ground"].frames["B3"].position == pytest.approx((-0.2, 0.3, 0.0))
