"""Verdicts on plans: what is met, missed and not decided, before and beyond the horizon, and with how many members."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from flexclear.artifacts.effect_size import POOLED, Agreement, agreement, compared_values, same_starts
from flexclear.artifacts.points import Point, dataset_of_batch
from flexclear.commands.new import write
from flexclear.dynamics.plan import search
from flexclear.post.answers.effect_sizes import staying_contacts_sentence
from flexclear.post.answers.plan import _verdict, dataset, table, verdict
from flexclear.scene.load import edited, load_scene
from flexclear.scene.plan_decisions import BOUND, Decision, Plan
from flexclear.scene.quantity import Quantity
from flexclear.scene.schema import Scene
from flexclear.scene.variants import Effect
from flexclear.study import effects
from flexclear.study.cost_design import Setting
from flexclear.study.members import MEMBERS, Budget, Members
from flexclear.workflow.task import Task


@pytest.mark.parametrize(
    "error, chance, allowed, said",
    [(0.0, 0.5, 1.0, "met"), (0.6, 0.5, 1.0, "not decided"), (1.2, 0.5, 1.0, "not decided"), (1.6, 0.5, 1.0, "missed")],
)
def test_met_and_missed_are_said_only_where_error_and_chance_agree(error, chance, allowed, said):
    assert verdict(Agreement(error, chance, allowed)) == said


@pytest.mark.parametrize("kept", [True, False])
def test_a_plan_names_the_contacts_that_stay_whatever_it_decides(kept: bool):
    decision = Decision(Effect("joint.A.clearance", "clearance", "", "A"), kept, BOUND, "", {"q": 1.0}, {"q": 0.0})
    plan = Plan((decision,), {"q": 2.0}, "", 1e-6, {"q": 0.0}, {}, 10, 1)
    made = dataset(plan, "title", {"q": "m"}).assign_attrs(staying=staying_contacts_sentence(["floor", "bed"]))
    said = table(made).notes[0]
    assert said.endswith("(its own effect: flexclear effects --of joint.floor joint.bed).")
    assert ("must be modelled" in said) == kept
    assert "floor and bed stay in every variant, as a ball on a plane has no ideal counterpart" in said


def test_an_undecided_verdict_says_how_far_single_runs_scatter():
    one = {"error": [0.5], "chance": [5.0], "allowed": [1.0], "horizon": [0.25], "scatter": [2.0]}
    coordinates = {"quantity": ["x"], "unit": ("quantity", ["m"])}
    compared = xr.Dataset({k: ("quantity", v) for k, v in one.items()}, coordinates, {"members": 4})
    said = _verdict(compared, 0)
    # four times as many halve the chance: half of what is allowed is left for it, a tenth of it
    beyond = "after 25% of the time runs of the full scene from slightly different starts differ by 2 m"
    assert said == f"not decided: {beyond}; 400 members would decide"
    assert _verdict(compared.assign(horizon=("quantity", [1.0])), 0) == "not decided: 400 members would decide"
    assert _verdict(compared.assign(error=("quantity", [8.0])), 0) == "missed, 8 times the allowed error"
    assert _verdict(compared.assign(chance=("quantity", [0.1])), 0).startswith(f"met to the horizon: {beyond}, and the")


def test_a_stress_that_no_rigid_body_has_is_planned_by_its_size_in_the_flexible_mechanism(tmp_path: Path):
    scene = load_scene(write("slider-crank", tmp_path)[0])
    stress = {"output.stress": ["rod"], "accuracy": {"rod.von_mises": "1 %"}}
    scene = edited(scene, stress)
    stressed = Point({"rod.von_mises.series": np.full((3, 1), 5e6), "rod.von_mises.largest": np.array(5e6)}, {}, {}, 1)
    without, unused = (lambda: Point({}, {}, {}, 1)), lambda: pytest.fail("the full scene need not be run")
    asked = search._requested_accuracies(
        scene, scene.requested_quantities(), (without, without, lambda: stressed, unused), watched=True
    )
    assert asked == {"rod.von_mises": pytest.approx(5e4)}


def _scattered(mean: np.ndarray, scatter: np.ndarray | float) -> Point:
    """A point with a series of positions along x and its standard deviation over members."""
    rows = np.zeros((len(mean), 3))
    rows[:, 0] = mean
    deviation = np.zeros_like(rows)
    deviation[:, 0] = scatter
    values = {"b.position.series": rows}
    return Point(values, {}, {"b.position.series": deviation}, 1)


def test_beyond_the_horizon_as_much_is_allowed_as_two_runs_of_the_scene_differ():
    """Members part by steps at half of the time; means that differ by less than two runs of the scene are as good."""
    n, requested, spread = 400, 1.0, 100.0
    later = np.arange(n) >= n // 2
    full = _scattered(np.zeros(n), np.where(later, spread, 0.0))
    q = Quantity("b", "position")
    same = agreement(full, full, q, 4, requested)
    assert (same.error, same.chance, same.horizon) == (0.0, 0.0, 1.0)  # the same members: nothing is chance
    early = _scattered(np.where(later, 0.0, 3.0), np.where(later, spread, 0.0))
    missed = agreement(early, full, q, 4, requested)
    assert missed.is_missed
    assert missed.error == pytest.approx(3.0)
    assert missed.allowed == requested
    late = _scattered(np.where(later, 60.0, 0.0), np.where(later, spread, 0.0))
    few, many = (agreement(late, full, q, members, requested) for members in (4, 4000))
    assert verdict(few) == "not decided"
    assert verdict(many) == "met to the horizon"
    assert many.allowed == pytest.approx(np.sqrt(2.0) * spread)
    # the spread is pooled over a twentieth of the series, so it is seen so much earlier
    assert many.horizon == pytest.approx(0.5, abs=0.5 * POOLED + 1.0 / n)


def test_from_the_same_starts_what_all_have_in_common_is_error_and_what_scatters_is_chance():
    """Two ways to integrate from three starts: their differences are 3, or as large as their scatter about 0.5."""
    n, requested, q = 400, 1.0, Quantity("b", "position")

    def point(*offsets: float) -> Point:
        rows = [{"b.position.series": np.full((n, 3), [offset, 0.0, 0.0])} for offset in offsets]
        mean = _scattered(np.full(n, np.mean(offsets)), np.std(offsets, ddof=1))
        return replace(mean, members=rows)

    full = point(0.0, 0.1, -0.1)
    common = same_starts(point(3.0, 3.1, 2.9), full, q, requested)
    assert (common.difference, common.uncertainty) == (pytest.approx(3.0), pytest.approx(0.0))
    scattered = same_starts(point(1.5, 0.1, -0.1), full, q, requested)
    assert (scattered.difference, scattered.uncertainty) == (0.0, pytest.approx(0.5))
    # beyond the horizon what exceeds chance counts, as a fraction of what two runs of the scene differ
    beyond = same_starts(point(1150.0, 1450.0, 850.0), point(0.0, 300.0, -300.0), q, requested)
    chance = 4.303 * 300.0 * np.sqrt(2.0 / 3.0)
    assert beyond.difference == pytest.approx(np.sqrt(1150.0**2 - chance**2) / (300.0 * np.sqrt(2.0)), rel=1e-3)
    # one of three members that goes elsewhere is not chance, though their scatter is as large as the difference
    astray = same_starts(point(0.0, 2.0, 3000.0), point(0.0, 1.0, -1.0), q, requested)
    assert astray.difference == pytest.approx(3002.0 / 3.0 / np.sqrt(2.0), rel=1e-3)


def test_verdicts_count_as_chance_what_differs_start_by_start_where_that_is_less():
    """Four starts that scatter by half, and runs that are off by half each: two means do not decide that."""
    n, requested, q, random = 400, 1.0, Quantity("b", "position"), np.random.default_rng(1)
    starts = random.normal(scale=0.5, size=4)

    def point(offset: float, members: bool) -> Point:
        rows = [{"b.position.series": np.full((n, 3), [start + offset, 0.0, 0.0])} for start in starts]
        mean = _scattered(np.full(n, np.mean(starts) + offset), np.full(n, np.std(starts, ddof=1)))
        return replace(mean, members=rows if members else [])

    alone, paired = (agreement(point(0.5, there), point(0.0, there), q, 4, requested) for there in (False, True))
    assert verdict(alone) == "not decided"
    assert verdict(paired) == "met"
    assert (paired.error, paired.chance) == (pytest.approx(0.5), pytest.approx(0.0))


@pytest.mark.parametrize("accepted", [1e-9, 0.0])
def test_a_refused_variant_is_repeated_once_at_a_tenth_of_the_scenes_tolerance(accepted: float):
    """Members need 1e-6 where the scene's own run has 1e-8, so a refusal may be that of the tolerance."""
    ball = Path(__file__).parents[2] / "scenes" / "checks" / "bounce.toml"
    scene, made = load_scene(ball, override={"view.watch": ["ball.position"]}), list[tuple[bool, float]]()

    class Place:
        def made(self, *tasks: Task) -> list[SimpleNamespace]:
            return [SimpleNamespace(task=task, dataset=partial(self.points, task)) for task in tasks]

        def points(self, task: Task) -> xr.Dataset:
            loads, rtol = task.params["simulate"]["scene"]["load"], task.params["simulate"]["scene"]["solver"]["rtol"]
            made.append((bool(loads), rtol))
            refused = "" if loads or rtol <= accepted else "the energy balance is off"
            values = {"ball.position.series": np.zeros((991, 3))}
            point = Point({} if refused else values, {}, {}, 1, refused)
            recorded = compared_values(scene.owners(), scene.watched_quantities())
            spent = {"members": 4, "compile_seconds": 0.0, "cpu_seconds": 4.0}
            return dataset_of_batch({"point": point}, recorded).assign_attrs(spent)

    account = Budget(1e3)
    own = Setting("dop853", 1e-8), 1.0
    answer = effects.examine_effects(scene, Place(), (4,), ["load.gravity"], own=own, budget=account)
    assert made == [(True, 1e-6), (False, 1e-6), (True, 1e-6), (False, 1e-9)]
    assert answer.task.params["undone"] == ""
    # two variants and one of them again, a member a second, and 0.6 s each
    assert account.spent == pytest.approx(3 * 4.6)


def test_members_are_added_until_all_is_decided_as_far_as_they_are_affordable(monkeypatch: pytest.MonkeyPatch):
    """Chance falls with the root of the members: four leave it at four times the rest, sixteen times as many do."""
    made = list[tuple[list[str], int]]()

    def points(runs: Members, chosen: dict[str, Scene], members: int) -> dict[str, Point]:
        made.append((list(chosen), members))
        for name, scene in chosen.items():
            runs.budget.spent += runs._predict(name, scene, members)
            runs.known[name] = members
        return dict.fromkeys(chosen, Point({}, {}, {}, 1))

    def undecided(members: int, points: Mapping[str, Point]) -> list[str]:
        return [] if verdict(Agreement(0.0, 4.0 * np.sqrt(4.0 / members), 1.0)) == "met" else ["slow"]

    monkeypatch.setattr(Members, "points", points)
    ball = load_scene(Path(__file__).parents[2] / "scenes" / "checks" / "bounce.toml")
    variants = dict.fromkeys(("full", "fast", "slow"), ball)

    def reached(budget: float) -> dict[str, int]:
        made.clear()
        return Members(None, [], Budget(budget), own=1.0).until_decided(variants, MEMBERS, undecided)

    assert reached(np.inf) == {"fast": 4, "slow": 64}
    assert made == [(["full", "fast", "slow"], 4), *((["full", "slow"], n) for n in MEMBERS[1:])]
    # runs of a second each, and 0.6 s besides: 13.8 s for four members of all, 9.2 s and 17.2 s for more of two
    assert reached(41.0) == {"fast": 4, "slow": 16}
    assert reached(10.0) == {"fast": 4}
    assert reached(1e-6) == {"fast": 4}
