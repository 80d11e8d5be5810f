"""The stability atlas: its cases, its verdicts, and that no case can stop it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from benchmarks.stability import cases, crew, mechanism, memory, page
from benchmarks.stability.cases import Case
from benchmarks.stability.mechanism import Parameters
from benchmarks.stability.memory import Memory
from benchmarks.stability.outcome import FINISHED, REFUSED, WRONG, Outcome, judge
from benchmarks.stability.page import Row
from benchmarks.stability.run import run_case
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
    found = cases.cases()
    assert len(found) >= 300
    for name, (low, high) in SPANS.items():
        values = [getattr(case.parameters, name) for case in found if case.sweep == name]
        assert min(values) == pytest.approx(low, rel=1e-12)
        assert max(values) == pytest.approx(high, rel=1e-12)


def test_the_nearest_geometry_has_the_condition_of_a_million():
    far, near = Parameters(), Parameters(nearness=1.0 - 1e-6)
    # the scene's own geometry is below 4.3; the last two decades are linear in the distance to the singular one
    assert mechanism.condition(far) < 5.0
    assert 3e5 < mechanism.condition(near) < 3e7
    tenfold = mechanism.condition(near) / mechanism.condition(replace(near, nearness=1.0 - 1e-5))
    assert tenfold == pytest.approx(10.0, rel=1e-3)


def test_a_seed_gives_the_same_random_cases_and_another_one_others():
    again = [case.parameters for case in cases.cases(7, 20) if case.sweep == "random"]
    assert again == [case.parameters for case in cases.cases(7, 20) if case.sweep == "random"]
    assert not set(again) & {case.parameters for case in cases.cases(8, 20)}


def finished_run(**changes: Any) -> xr.Dataset:
    """A dataset with what a verdict looks at; nothing is wrong with it."""
    time_, one = np.linspace(0.0, 1.0, 5), np.ones(5)
    values = {name: ("time", one) for name in ("kinetic", "potential", "elastic", "dissipated", "drive_work")}
    values |= {"energy_error": ("time", 1e-9 * one), "constraint_error": ("time", 1e-14 * one)}
    values |= {"contact_friction_power": (("time", "contact"), -one[:, None]), "horizon": ((), 0.25)}
    values |= {"event_kind": ("event", [1, 2, 1]), "event_peak_force": ("event", [3.0, np.nan, 7.0])}
    values |= {name: ("time", value * one) for name, value in changes.items()}
    return xr.Dataset(values, {"time": time_}, {"method": "dop853", "evaluations": 12})


def test_a_run_without_a_fault_is_finished():
    found = judge(finished_run(), 1e-7, 2.0)
    assert (found.verdict, found.reason, found.impacts, found.evaluations) == (FINISHED, "", 2, 12)
    assert (found.peak_force, found.horizon_share, found.ledger) == (7.0, 0.25, 1e-9)


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
    assert found.verdict == WRONG
    assert words in found.reason


def test_friction_that_feeds_energy_is_wrong():
    run = finished_run()
    run["contact_friction_power"][2, 0] = 1e-12
    assert "friction" in judge(run, 0.0, 0.0).reason


def test_a_case_that_hangs_and_one_that_dies_are_outcomes_and_the_others_go_on():
    todo = [Case("joints", Parameters(joints=n)) for n in (1, 2, 3, 4)]
    found = {case.parameters.joints: outcome for case, outcome in crew.outcomes(todo, 1, hard_cases.work, limit=2)}
    assert {n: outcome.verdict for n, outcome in found.items()} == {1: FINISHED, 2: WRONG, 3: WRONG, 4: FINISHED}
    # the system counts in whole seconds: what ends at once has at least one
    assert "did not end within 2 s" in found[2].reason
    assert "died (exit code 7)" in found[3].reason


def test_outcomes_are_remembered_until_their_sources_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    good, bad = Case("joints", Parameters()), Case("joints", Parameters(joints=2))
    first = Memory(tmp_path)
    assert first.recall(good) is None
    first.learn(good, found := Outcome(FINISHED, "", "dop853", "", 1e-9, 1e-15, 1e-7, 1.0, 28, 3e3, 20_000, 0.5))
    first.learn(bad, Outcome(REFUSED, "too stiff"))
    assert Memory(tmp_path).recall(good) == found
    monkeypatch.setattr(memory, "sources", lambda parameters: "edited")
    assert Memory(tmp_path).recall(good) is None
    trusting = Memory(tmp_path, trusting=True)
    assert trusting.recall(good) is not None
    assert trusting.recall(bad) is None


def test_the_page_counts_refusals_apart_and_quotes_them(tmp_path: Path):
    made = cases.cases(7, 6)
    rows = [Row(case, Outcome(FINISHED, method="dop853", ledger=1e-9, closure=1e-15, evaluations=9)) for case in made]
    rows[0] = Row(made[0], Outcome(REFUSED, "at t = 0.1 s: the step shrank"))
    written = page.write(rows, tmp_path, 7, "a command").read_text()
    assert f"**{len(made) - 1} of {len(made)} finished**, 1 were refused" in written
    assert "refused (clearance 1e-06): at t = 0.1 s: the step shrank" in written
    table = (tmp_path / "stability" / "cases_7.csv").read_text().splitlines()
    assert len(table) == len(made) + 1
    last = dict(zip(table[0].split(","), table[-1].split(","), strict=True))
    assert float(last["clearance"]) == made[-1].parameters.clearance  # so that the case can be run again exactly
    for name in ("sweeps", "ledger", "horizon", "random"):
        assert f"stability/{name}.png" in written
        assert (tmp_path / "stability" / f"{name}.png").stat().st_size > 10_000


def test_the_papers_case_finishes_and_one_without_evaluations_is_refused(monkeypatch: pytest.MonkeyPatch):
    found = run_case(Parameters())
    assert (found.verdict, found.reason) == (FINISHED, "")
    assert found.impacts == 28  # as docs/integrators.md
    assert found.deviation < 1e-4
    monkeypatch.setattr(mechanism, "CAP", 1000)
    refused = run_case(Parameters())
    assert refused.verdict == REFUSED
    assert "limit of 1000 evaluations" in refused.reason
