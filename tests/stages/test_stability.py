"""The stability atlas: its cases, its verdicts, and that no case can stop it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from benchmarks import atlas, log, processes
from benchmarks.atlas import Parameters, judge, run_case
from benchmarks.families.stability import FAMILY
from benchmarks.family import FINISHED, REFUSED, WRONG, Case, Record
from tests.stages import hard_cases

#: ranges that the sweeps must span
SPANS = {
    "clearance": (1e-6, 2e-3),
    "stiffness": (1e-2, 1e4),
    "restitution": (0.0, 1.0),
    "friction": (0.0, 0.5),
    "speed": (0.1, 20.0),
    "mass": (1e-3, 1e3),
    "modes": (0, 30),
    "damping": (0.0, 0.05),
    "joints": (1, 5),
    "strokes": (1, 100),
}


def test_the_sweeps_span_what_they_say_and_there_are_three_hundred_cases():
    found = FAMILY.cases(**FAMILY.settings)
    assert len(found) >= 300
    assert len({case.name for case in found}) == len(found)
    for name, (low, high) in SPANS.items():
        values = [getattr(case.of, name) for case in found if atlas.sweep(case.name) == name]
        assert min(values) == pytest.approx(low, rel=1e-12)
        assert max(values) == pytest.approx(high, rel=1e-12)


def condition(p: Parameters) -> float:
    """Condition number of the legs' directions at the start: of the map from the platform's motion to leg rates.

    Length scale 0.1 m; the central chain leaves rotation and lift.
    """
    rows = []
    layout = atlas.layout(p.nearness)
    for a, b in zip(layout.A, layout.B, strict=True):
        leg = a - b + np.array([0.0, 0.0, layout.height])
        leg /= np.linalg.norm(leg)
        rows.append([*(np.cross(a, leg) / 0.1), leg[2]])
    return float(np.linalg.cond(np.array(rows)))


def test_the_nearest_geometry_has_the_condition_of_a_million():
    far, near = Parameters(), Parameters(nearness=1.0 - 1e-6)
    # the scene's own geometry is below 4.3; the last two decades are linear in the distance to the singular one
    assert condition(far) < 5.0
    assert 3e5 < condition(near) < 3e7
    tenfold = condition(near) / condition(replace(near, nearness=1.0 - 1e-5))
    assert tenfold == pytest.approx(10.0, rel=1e-3)


def test_a_seed_gives_the_same_random_cases_and_another_one_others():
    again = [case for case in atlas.cases(7, 20) if atlas.sweep(case.name) == "random"]
    assert again == [case for case in atlas.cases(7, 20) if atlas.sweep(case.name) == "random"]
    assert not {case.of for case in again} & {case.of for case in atlas.cases(8, 20)}


def finished_run(**changes: Any) -> xr.Dataset:
    """A dataset with what a verdict looks at; nothing is wrong with it."""
    time_, one = np.linspace(0.0, 1.0, 5), np.ones(5)
    values = {name: ("time", one) for name in ("kinetic", "potential", "elastic", "dissipated", "drive_work")}
    values |= {"energy_error": ("time", 1e-9 * one), "constraint_error": ("time", 1e-14 * one)}
    values |= {"contact_friction_power": (("time", "contact"), -one[:, None]), "horizon": ((), 0.25)}
    values |= {
        "event_kind": ("event", ["closing", "compression", "closing"]),
        "event_peak_force": ("event", [3.0, np.nan, 7.0]),
    }
    values |= {name: ("time", value * one) for name, value in changes.items()}
    return xr.Dataset(values, {"time": time_}, {"method": "dop853", "evaluations": 12})


def test_a_run_without_a_fault_is_finished():
    found = judge(finished_run(), 1e-7, 2.0)
    assert [found[k] for k in ("verdict", "reason", "impacts", "evaluations")] == [FINISHED, "", 2, 12]
    assert [found[k] for k in ("peak_force", "horizon_share", "ledger")] == [7.0, 0.25, 1e-9]


@pytest.mark.parametrize(
    "changes, deviation, words",
    [
        ({"kinetic": np.array([1.0, 1.0, np.nan, 1.0, 1.0])}, 0.0, "not finite"),
        ({"energy_error": 1e-3}, 0.0, "energy off by 1.0e-03"),
        ({"constraint_error": 1e-6}, 0.0, "open by 1.0e-06 m"),
        ({}, 0.5, "velocity off by 5.0e-01"),
    ],
)
def test_a_run_with_a_fault_is_wrong_and_says_why(changes: dict[str, Any], deviation: float, words: str):
    found = judge(finished_run(**changes), deviation, 0.0)
    assert found["verdict"] == WRONG
    assert words in found["reason"]


def test_friction_that_feeds_energy_is_wrong():
    run = finished_run()
    run["contact_friction_power"][2, 0] = 1e-12
    assert "friction" in judge(run, 0.0, 0.0)["reason"]


def test_a_case_that_hangs_and_one_that_dies_are_outcomes_and_the_others_go_on():
    todo = [Case(f"joints {n}", Parameters(joints=n)) for n in (1, 2, 3, 4, 5)]
    found = {case.of.joints: record for case, record in processes.outcomes(todo, 1, hard_cases.work, limit=2)}
    assert {n: record["verdict"] for n, record in found.items()} == {
        1: FINISHED,
        2: WRONG,
        3: WRONG,
        4: WRONG,
        5: FINISHED,
    }
    # the system counts in whole seconds: what ends at once has at least one
    assert "did not end within 2 s" in found[2]["reason"]
    assert "died (exit code 7)" in found[3]["reason"]
    assert "died (SIGSEGV)" in found[4]["reason"]


def test_outcomes_are_remembered_until_their_sources_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    good, bad = Case("joints 1", Parameters()), Case("joints 2", Parameters(joints=2))
    first = log.Memory("stability", FAMILY, folder=tmp_path)
    assert first.recall(good) is None
    first.learn(good, found := [{"case": good.name, "verdict": FINISHED, "ledger": 1e-9, "deviation": None}])
    first.learn(bad, [{"case": bad.name, "verdict": REFUSED, "reason": "too stiff"}])
    first.forget([good, bad])  # outcomes stand, unlike times
    assert log.Memory("stability", FAMILY, folder=tmp_path).recall(good) == found
    monkeypatch.setattr(log, "sources", lambda spec: "edited")
    assert log.Memory("stability", FAMILY, folder=tmp_path).recall(good) is None
    trusting = log.Memory("stability", FAMILY, trusting=True, folder=tmp_path)
    assert trusting.recall(good) == found
    assert trusting.recall(bad) is None


def recorded(case: Case, **outcome: Any) -> Record:
    """A record of a case, with what the page looks at."""
    numbers = {"ledger": 1e-9, "closure": 1e-15, "deviation": None, "horizon_share": 1.0, "evaluations": 9}
    found = {"verdict": FINISHED, "method": "dop853", "switched": "", "seconds": 0.5, **numbers, **outcome}
    return {"case": case.name, "sweep": atlas.sweep(case.name), "parameters": vars(case.of), **found}


def test_the_page_counts_and_quotes_refusals():
    made = [case for case in atlas.cases(7, 6) if atlas.sweep(case.name) in ("clearance", "speed", "random")]
    records = [recorded(case) for case in made]
    records[0] |= {"verdict": REFUSED, "reason": "at t = 0.1 s: the step shrank"}
    written = FAMILY.show(records)
    assert f"**{len(made) - 1} of {len(made)} finished**, 1 were refused" in written
    assert "refused (clearance): at t = 0.1 s: the step shrank" in written
    assert "Seed of the random points: 7." in written
    pictures = FAMILY.files(records)
    assert set(pictures) == {f"stability/{name}.png" for name in ("sweeps", "ledger", "horizon", "random")}
    assert all(len(picture) > 10_000 for picture in pictures.values())


def test_the_papers_case_finishes_and_one_without_evaluations_is_refused(monkeypatch: pytest.MonkeyPatch):
    found = run_case(Parameters())
    assert (found["verdict"], found["reason"]) == (FINISHED, "")
    assert found["impacts"] == 28  # as docs/integrators.md
    assert found["deviation"] < 1e-4
    monkeypatch.setattr(atlas, "CAP", 1000)
    refused = run_case(Parameters())
    assert refused["verdict"] == REFUSED
    assert "limit of 1000 evaluations" in refused["reason"]
