"""A cost study: what is measured alone, in which order, what a budget leaves undone, whether its errors are right."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics
from flexclear.artifacts import quantities
from flexclear.artifacts.store import Store
from flexclear.commands.new import KINDS, write
from flexclear.post.cost.study import sentences
from flexclear.scene.load import edited, load_scene
from flexclear.scene.quantity import parse
from flexclear.scene.schema import Scene
from flexclear.stages import scenes, simulation
from flexclear.stages.graph import Graph
from flexclear.stages.workplace import Workplace, open_workplace
from flexclear.study import cost, cost_design, members
from flexclear.study.cost_design import Setting
from flexclear.study.members import Budget
from flexclear.system.errors import InputError
from flexclear.system.progress import silent
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.task import in_order
from tests.stages.conftest import Command

OWN = Setting("dop853", 1e-6)


@pytest.fixture
def csj(root: Path) -> Scene:
    return load_scene(root / "scenes" / "sps4" / "csj.toml")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Workplace:
    root = Path(__file__).parents[2]
    return Workplace(Store(tmp_path_factory.mktemp("cost")), Sources(root / "pipeline"), jobs=1)


@pytest.fixture(scope="module")
def swing() -> Scene:
    """A pendulum at a loose tolerance, whose errors are far above rounding."""
    path = Path(__file__).parents[2] / "scenes" / "checks" / "pendulum.toml"
    return load_scene(path, {"solver": {"integrator": "dop853", "rtol": 1e-6}, "time.end": "2 s"})


@pytest.fixture(scope="module")
def study(swing: Scene, place: Workplace) -> cost.Study:
    found = cost.Study(swing, place, Budget(60.0))
    found.measure_neighbours()
    return found


def test_a_first_answer_has_tighter_and_looser_runs_and_compiles_another_method_for_fixed_steps_only(csj: Scene):
    designs = cost_design.neighbours(csj, OWN)
    first = designs[: cost_design.FIRST]
    assert first[0].key == "as it is"
    tolerances = [d.scene.solver.rtol for d in first if d.scene.solver.integrator == "dop853"]
    assert min(tolerances) < OWN.rtol < max(tolerances)
    assert {d.scene.solver.integrator for d in first} == {"dop853"}
    assert designs[cost_design.FIRST + 1].scene.solver.integrator != "dop853"
    fixed = cost_design.neighbours(csj, Setting("rk4", 1e-10, 1e-5))[: cost_design.FIRST]
    assert any(d.chooses_steps for d in fixed)
    assert len({d.key for d in designs}) == len(designs)


def test_fixed_steps_are_compared_with_other_steps_and_with_chosen_ones(csj: Scene):
    designs = cost_design.neighbours(csj, Setting("rk4", 1e-10, 1e-5))
    assert {d.scene.solver.step for d in designs if not d.chooses_steps} == {2.5e-6, 5e-6, 1e-5, 2e-5, 4e-5}
    assert {d.scene.solver.step for d in designs[1:] if d.chooses_steps} == {None}


def test_points_are_measured_alone(study: cost.Study):
    points = [task for task in in_order([study.task()]) if task.stage == "cost-point"]
    assert len(points) == len(study.points) - 1  # the scene as it is, which is also the point at its own tolerance
    assert all(point.exclusive for point in points)


def test_errors_are_those_against_a_converged_run_of_another_method(study: cost.Study, swing: Scene, place: Workplace):
    found = study.answer().dataset()
    solver = {"solver": {"integrator": "radau", "rtol": 1e-12}}
    converged = scenes.run(edited(swing, solver), place)
    reported = 0
    for rtol in found["rtol"].values[found["integrator"].values == "dop853"]:
        errors = found["error"].isel(run=(found["integrator"] == "dop853") & (found["rtol"] == rtol)).squeeze("run")
        if np.isnan(errors).any():
            continue  # too loose: the energy balance does not close
        other = scenes.run(edited(swing, {"solver": {"integrator": "dop853", "rtol": float(rtol)}}), place)
        for name in map(str, found["quantity"].values):
            q = parse(name, swing.owners())
            error = quantities.largest_distance(other, converged, q) / max(quantities.scale(converged, q), 1e-300)
            here = errors.sel(quantity=name)
            unsure = float(found.reference_uncertainty.sel(quantity=name))
            if float(here) > 20.0 * unsure:  # of errors near the reference's own nothing is claimed
                assert 0.5 < error / float(here) < 2.0
                reported += 1
    assert reported >= 3


def test_a_small_budget_leaves_points_undone_and_a_larger_goes_on(swing: Scene, place: Workplace, study: cost.Study):
    small = cost.Study(swing, place, Budget(1e-3))
    small.measure_neighbours(most=cost_design.FIRST)
    assert [d.key for d in small.points] == ["as it is", "dop853, rtol 1e-06"]  # one run
    assert len(small.undone) == cost_design.FIRST - 2
    mine, others = small.task().inputs["own"], study.task().inputs["own"]
    assert mine.params == others.params


def test_the_answer_names_its_cost_its_error_and_the_next_digit(study: cost.Study):
    found = study.answer().dataset()
    text = sentences(found)
    assert "dop853 at rtol 1e-06" in text
    assert "The integration errs at the outputs" in text
    assert "One more digit costs" in text
    assert found.attrs["own_evaluations"] > 0
    assert found.attrs["complete"] == 0  # the neighbourhood is not all
    assert not np.isnan(found.own_error).any()


def test_integrators_that_are_named_are_compared_and_unknown_ones_refused(csj: Scene):
    assert {d.chooses_steps for d in cost_design.all_methods(csj, ("rk4",))} == {False}
    with pytest.raises(InputError, match="did you mean 'radau'"):
        cost_design.all_methods(csj, ("radua",))


def test_points_keep_the_limits_of_the_scene(csj: Scene):
    limited = edited(csj, {"solver": {"rtol": 1e-7, "evaluations": 1234}})
    designs = [*cost_design.neighbours(limited, OWN), *cost_design.all_methods(limited)]
    assert {design.scene.solver.evaluations for design in designs} == {1234}


def test_a_method_that_used_up_its_evaluations_is_run_at_no_tighter_tolerance(
    swing: Scene, place: Workplace, monkeypatch: pytest.MonkeyPatch
):
    refused = xr.Dataset(attrs={"refused": "the limit of 100000 evaluations is reached ([solver.evaluations])"})
    refused.attrs["compile_seconds"] = 1.0
    monkeypatch.setattr(Workplace, "datasets", lambda _, *tasks: [refused] * len(tasks))
    study = cost.Study(swing, place, Budget(1e9), own=1e4, seconds_each=1e-6)
    first, *tighter = [design for design in cost_design.all_methods(swing, ("radau",)) if design.chooses_steps]
    study._measure_affordable([first, *tighter])
    assert [design.key for design in study.points] == [first.key]
    assert study.undone == tighter


def test_the_limit_of_a_trial_run_is_not_called_the_scenes(
    tmp_path: Path, fresh: Path, command: Command, monkeypatch: pytest.MonkeyPatch
):
    """The run at a tighter tolerance, which determines the error of a compared run, has a limit of its own."""
    monkeypatch.setattr(cost_design, "FEWEST_EVALUATIONS", 1)
    monkeypatch.setattr(cost_design, "TIGHTER_EVALUATIONS", 1)
    one = write("pendulum", tmp_path)[0]
    other = one.with_name("heavy.toml")
    other.write_text(one.read_text().replace('mass = "1 kg"', 'mass = "2 kg"'))
    said = command("compare", one, other, "--jobs", "1").err
    assert "evaluations is reached (a trial run's own limit, not the scene's [solver.evaluations])" in said


def test_what_two_studies_need_is_one_run(swing: Scene, place: Workplace, study: cost.Study):
    """The run at a tenth of the tolerance is a point of the costs and the error of comparisons and effects."""
    tighter = members.tighter_run(swing, members.setting_of(swing, place))
    assert tighter is not None
    tasks = tighter, study.runs["dop853, rtol 1e-07"], members.error_runs(swing, study.setting).runs["tight"]
    assert len({made.record.key for made in place.made(*tasks)}) == 1
    (kept,) = place.datasets(study.runs["as it is"])
    own = scenes.run(swing, place)
    assert kept["position"].identical(own["position"].sel(body=kept["body"]))


def test_members_that_run_at_a_looser_tolerance_err_as_much_more(csj: Scene):
    """In proportion to their tolerance, which is tighter than necessary in the scene's own run."""
    own = Setting("dop853", 1e-9)
    assert members.error_runs(csj, own).looser == pytest.approx(members.MEANS / 1e-9)
    assert members.error_runs(csj, Setting("rk4", 1e-10, 1e-5)).looser == 1.0


def test_a_budget_that_is_no_time_is_refused(command: Command):
    assert "--budget soon" in command("cost", "checks/pendulum", "--budget", "soon", code=2).err


# What accuracy costs, for each template: how soon there is an answer, and whether its errors are right ----------------


#: of two processors in 30 s and in two minutes [s]; compiling is included
FIRST, ALL = 60.0, 240.0
#: a tolerance tighter by so much makes the reference of the other method converged next to the scene's own run
TIGHTER, TIGHTEST = 1e-3, 1e-13
#: what the study's errors may be wrong by: they are maxima over a few hundred outputs, which both runs share
FACTOR = 2.0
#: smaller errors are rounding, which the closures of the mechanisms magnify
ROUNDING = 1e-11


def _spent() -> float:
    """Processor time of this process and of those that it started and that have ended [s]."""
    return sum(os.times()[:4])


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(KINDS))
def test_the_first_answer_comes_soon_and_its_errors_are_those_of_a_converged_run_of_another_method(
    kind: str, tmp_path: Path, fresh: Path
):
    scene, workplace = load_scene(write(kind, tmp_path)[0]), open_workplace()
    workplace = Workplace(workplace.store, workplace.sources, jobs=1)
    begun, first = _spent(), list[float]()
    study = cost.measure_costs(scene, workplace, first_answer=lambda made: first.append(_spent() - begun)).dataset()
    print(f"{kind}: first answer after {first[0]:.1f} s of processor time, done after {_spent() - begun:.1f} s")
    assert first[0] <= FIRST
    assert _spent() - begun <= ALL

    own, rtol = str(study.attrs["own_integrator"]), float(study.attrs["own_rtol"])
    other = {"integrator": "dop853" if own != "dop853" else "dopri5", "rtol": max(TIGHTER * rtol, TIGHTEST)}
    mine, reference = (_run(scene, workplace, solver) for solver in ({"integrator": own, "rtol": rtol}, other))
    until = study.attrs["horizon"] if study.attrs["horizon"] != "none" else np.inf
    chosen = scene.requested_quantities() if scene.accuracy is not None else scene.watched_quantities()
    for q in chosen:
        if not q.over_time:
            continue
        reported = float(study["own_error"].sel(quantity=q.name))
        true = quantities.largest_distance(mine, reference, q, until) / (quantities.scale(reference, q) or 1.0)
        print(f"{kind} {q.name}: error {reported:.2e}, by {other['integrator']} {true:.2e}")
        assert reported <= FACTOR * true + ROUNDING
        assert true <= FACTOR * reported + ROUNDING


def _run(scene: Scene, workplace: Workplace, solver: dict[str, Any]) -> xr.Dataset:
    """The scene's run by a method, without a horizon of its own."""
    variant = edited(scene, {"solver": solver, "accuracy": None, "ensemble": None})
    bodies = Graph(variant, shown=False).bodies()
    outcome = workplace.bring(list(bodies.values()))
    inputs = {name: workplace.store.load(outcome.records[task]) for name, task in bodies.items()}
    filled = simulation.rebuild(simulation.params(variant), inputs)
    return dynamics.simulate(filled, simulation.bundles(inputs), silent)
