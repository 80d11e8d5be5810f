"""Scenes that ask for accuracy and name no integrator: which one is chosen, why, and what becomes of a wrong guess."""

from dataclasses import dataclass, field, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from flexclear import dynamics, load_scene
from flexclear.artifacts import quantities
from flexclear.artifacts.effect_size import compared_values as recorded_quantities
from flexclear.artifacts.labelled import LabelledArrays, label_dataset
from flexclear.dynamics import analyses
from flexclear.dynamics.effects import schemes
from flexclear.dynamics.record.point import Runner
from flexclear.dynamics.run import progress_rate, trajectory
from flexclear.dynamics.run.method_choice.accuracy import Attempt, Search, _climb, by_default
from flexclear.dynamics.run.method_choice.method_selection import Costs, Rates
from flexclear.dynamics.run.progress_rate import Look, limited_by_stability, pace
from flexclear.scene.load import edited, with_numbers
from flexclear.scene.quantity import parse
from flexclear.scene.schema import Scene
from flexclear.system.errors import SolverError
from flexclear.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles

RINGING = TREE / "scenes" / "sps4" / "far_cb.toml"
RIGID = TREE / "scenes" / "sps4" / "csj.toml"
#: a part of the stroke, with a hundred periods of the rod's slowest vibration but one
SHORT = {"time.end": "20 ms", "output.interval": "1 ms"}
WANTED = {"platform.velocity": "0.1 %"}


def simulated(scene: Scene, reported: list[str] | None = None) -> xr.Dataset:
    said = [] if reported is None else reported
    return dynamics.simulate(
        scene, bundles(scene), lambda fraction, text: said.append(text) if fraction is None else None
    )


@cache
def reference() -> xr.Dataset:
    """The ringing rod, by explicit steps at a tight tolerance."""
    return simulated(load_scene(RINGING, {**SHORT, "solver.rtol": 1e-11}))


def test_forces_of_rounding_are_requested_by_no_default() -> None:
    """A balanced rotor about an oblique axis, without weight: all its joints' forces are rounding."""
    rotor = TREE / "scenes" / "checks" / "overhung_rotor.toml"
    frame, speed = {"axis": (1.0, 2.0, 3.0)}, (0.0, 100.0)
    turned = {"body.ground.frames.axle": frame, "body.disc.pose": None, "drive.axle.law.coefficients": speed}
    run = simulated(load_scene(rotor, {**turned, "time.end": "1 s", "solver.by_need": True}))
    assert run.attrs["accuracy_verdict"] == "met"
    assert "force" not in run.attrs["accuracy_requested"]


def test_ringing_modes_get_the_method_that_follows_them() -> None:
    reported: list[str] = []
    scene = load_scene(RINGING, {**SHORT, "accuracy": WANTED})
    run = simulated(scene, reported)
    assert run.attrs["method"] == "exponential"
    assert "the modes' fastest vibration" in run.attrs["method_reason"]
    assert run.attrs["method_reason"] in reported
    velocity = parse("platform.velocity", scene.owners())
    error = quantities.largest_distance(run, reference(), velocity) / quantities.scale(reference(), velocity)
    assert run.attrs["accuracy_verdict"] == "met"
    assert error < 3e-3  # what is requested, and the estimate's own doubt, as in test_accuracy
    # an explicit method is stable with 140 evaluations per millisecond; here some 25 are taken
    assert run.attrs["evaluations"] < 0.5 * reference().attrs["evaluations"]


def test_a_scene_without_solver_and_accuracy_runs_at_the_default_tolerance_where_that_is_cheap() -> None:
    left_open = load_scene(RIGID, {**SHORT, "solver.by_need": True})
    assert left_open.by_need()
    assert not load_scene(RIGID, SHORT).by_need()  # which gives a tolerance
    xr.testing.assert_identical(
        simulated(left_open).drop_attrs(), simulated(load_scene(RIGID, {**SHORT, "solver.rtol": 1e-10})).drop_attrs()
    )


@pytest.fixture
def dear(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is too dear is noticed early."""
    monkeypatch.setattr(progress_rate, "AFFORDABLE", 500)
    monkeypatch.setattr(progress_rate, "EARLIEST", 200)
    monkeypatch.setattr(trajectory, "SLICE", 200)


@pytest.mark.usefixtures("dear")
def test_where_that_is_dear_it_is_as_exact_as_a_thousandth_of_each_range() -> None:
    said: list[str] = []
    scene = load_scene(RINGING, {**SHORT, "solver.by_need": True})
    run = simulated(scene, said)
    assert any("dop853 would take some" in text for text in said)
    assert run.attrs["accuracy_verdict"] == "met"
    assert run.attrs["evaluations"] < 0.5 * reference().attrs["evaluations"]
    for name in ("platform.position", "platform.velocity"):
        quantity = parse(name, scene.owners())
        error = quantities.largest_distance(run, reference(), quantity) / quantities.scale(reference(), quantity)
        assert error < 3e-3  # the default request, and the estimate's own doubt, as above


@pytest.mark.usefixtures("dear")
def test_a_given_tolerance_stays_where_the_method_is_chosen() -> None:
    said: list[str] = []
    scene = load_scene(RINGING, {**SHORT, "solver.by_need": True, "solver.rtol": 1e-6})
    run = simulated(scene, said)
    assert any("dop853 would take some" in text and "tolerance of 1e-06" in text for text in said)
    assert run.attrs["method"] == "exponential"
    assert run.attrs["method_reason"]
    assert "accuracy_rtol" not in run.attrs
    by_hand = simulated(edited(scene, {"solver.integrator": "exponential"}))
    xr.testing.assert_identical(run.drop_attrs(), by_hand.drop_attrs())


@pytest.mark.usefixtures("dear")
def test_dear_points_and_members_have_the_tolerance_of_runs_that_none_is_compared_with() -> None:
    scene = load_scene(RIGID, {**SHORT, "solver.by_need": True})
    given = load_scene(RIGID, {**SHORT, "solver.integrator": "radau", "solver.rtol": progress_rate.UNVERIFIED})
    speed = recorded_quantities(scene.owners(), [parse("platform.velocity", scene.owners())])
    points = [Runner(bundles(one), speed).run(one) for one in (scene, given)]
    assert not points[0].refused
    assert points[0].values.keys() == points[1].values.keys()
    for name, values in points[0].values.items():
        np.testing.assert_array_equal(values, points[1].values[name])
    ensembles = [
        analyses.ensemble(edited(one, {"ensemble": {"members": 2}}), bundles(one), silent) for one in (scene, given)
    ]
    np.testing.assert_array_equal(ensembles[0]["velocity"], ensembles[1]["velocity"])


def test_an_edit_of_the_method_closes_the_choice_and_no_other_edit_does() -> None:
    scene = load_scene(TREE / "scenes" / "checks" / "pendulum.toml")
    assert scene.by_need()
    assert edited(scene, {"solver.evaluations": 1000}).by_need()
    assert edited(scene, {"accuracy": {"bob.position": "1 um"}}).by_need()
    assert edited(scene, {"solver.rtol": 1e-6}).solver.by_need == "integrator"
    assert with_numbers(scene, {"solver.rtol": 1e-6}).solver.by_need == "integrator"
    assert not with_numbers(scene, {"solver.integrator": "radau"}).by_need()


def test_a_stiff_choice_by_hand_stays() -> None:
    scene = load_scene(RINGING, {**SHORT, "accuracy": WANTED, "solver.integrator": "dop853"})
    assert not scene.by_need()
    assert [scheme.integrator for scheme in schemes(scene)] == ["dop853", "radau"]


def test_rigid_bodies_get_the_explicit_method() -> None:
    scene = load_scene(RIGID, {**SHORT, "accuracy": {"platform.velocity": "1 %"}})
    run = simulated(scene)
    assert run.attrs["method"] == "dop853"
    assert "evaluations of dop853 for stability" in run.attrs["method_reason"]
    assert [scheme.integrator for scheme in schemes(scene)] == ["dop853", "radau"]


def known(**seen: tuple[float, float]) -> Costs:
    runs = {name: dict([run]) for name, run in seen.items()}
    return Costs(Rates(6e4, 20.0), 0.18, ("dop853", "exponential", "radau"), runs)


def test_what_a_run_took_decides_about_the_next() -> None:
    """An explicit method takes 26 000 evaluations here whatever the tolerance, up to where accuracy limits it."""
    assert known().best(1e-4) == "exponential"
    assert known(exponential=(1e-4, 400.0)).best(1e-6) == "exponential"
    assert known(exponential=(1e-4, 400.0)).best(1e-14) == "dop853"
    # where contacts set its steps, it is the dearer one
    assert known(exponential=(1e-4, 3e4)).best(1e-4) == "dop853"


def test_two_runs_tell_how_evaluations_grow_with_the_tolerance() -> None:
    """Those of contacts hardly do: where they are most of them, the estimate's order says little."""
    costs = Costs(Rates(6e4, 20.0), 0.18, ("dop853", "exponential", "radau"), has_contacts=True)
    costs.learn(1e-3, "exponential", xr.Dataset(attrs={"method": "exponential", "evaluations": 20_000}))
    assert costs.best(1e-6) == "dop853"
    costs.learn(1e-5, "exponential", xr.Dataset(attrs={"method": "exponential", "evaluations": 21_000}))
    assert costs.best(1e-6) == "exponential"
    assert costs.best(1e-14) == "dop853"


def test_a_guess_that_runs_correct_is_not_repeated() -> None:
    costs = known()
    costs.learn(1e-4, "exponential", xr.Dataset(attrs={"method": "dop853", "evaluations": 1}))
    assert costs.best(1e-4) == "dop853"
    assert "began with exponential" in costs.why(1e-4)
    costs.learn(1e-4, "dop853", xr.Dataset(attrs={"method": "radau", "evaluations": 1}))
    assert costs.best(1e-4) == "radau"
    assert "stability limited the steps of dop853 in a run before" in costs.why(1e-4)


def test_what_is_too_dear_at_a_tight_tolerance_is_taken_again_at_a_loose_one() -> None:
    costs = known(exponential=(1e-5, 1200.0))
    costs.learn(1e-7, "exponential", xr.Dataset(attrs={"method": "dop853", "evaluations": 26_000}))
    assert costs.best(1e-7) != "exponential"
    assert costs.best(1e-4) == "exponential"


def test_where_the_explicit_method_is_dear_the_stiff_one_is_tried() -> None:
    dear = known(exponential=(1e-4, 3e5), dop853=(1e-4, 9e4))
    assert dear.best(1e-4) == "radau"
    assert known(exponential=(1e-4, 3e5), dop853=(1e-4, 2e3)).best(1e-4) == "dop853"
    dear.learn(1e-4, "radau", xr.Dataset(attrs={"method": "radau", "evaluations": 26_000}))
    assert dear.best(1e-4) == "radau"
    # evaluations of the low order grow fast with the tolerance
    assert dear.best(1e-14) == "dop853"


def test_a_run_that_was_handed_over_reports_the_cost_of_its_last_method() -> None:
    early, late = known(exponential=(1e-4, 5e4)), known(exponential=(1e-4, 5e4))
    for costs, left in ((early, (4e4, 0.2)), (late, (4e4, 0.97))):
        costs.expected["exponential"], costs.left = 9e4, left
        costs.learn(1e-5, "exponential", xr.Dataset(attrs={"method": "radau", "evaluations": 44_000}))
    assert early.seen["radau"] == {1e-5: pytest.approx(5000.0)}
    assert "radau" not in late.seen


def test_the_outcome_of_a_perturbed_run_is_not_reported_as_that_of_the_run() -> None:
    """The twin may be handed on where the run is not, and is made before, next to or after it."""
    costs = known(exponential=(1e-4, 400.0))
    solver = SimpleNamespace(integrator="exponential")
    engine = SimpleNamespace(model=SimpleNamespace(scene=SimpleNamespace(solver=solver)), start=0.0)
    crawling = looks((0.0, 0), (1e-6, 4_000_000), (2e-6, 8_000_000))
    run, twin = (panel["exponential"][0] for panel in costs.judges(1e-4)[:2])
    assert "at this progress rate" in twin.verdict(engine, crawling)
    costs.learn(1e-4, "exponential", xr.Dataset(attrs={"method": "exponential", "evaluations": 30_000}))
    assert costs.seen["exponential"] == {1e-4: 30_000.0}  # 1 when all eight millions of the twin were taken off
    assert "at this progress rate" in run.verdict(engine, crawling)
    assert costs.left == (8_000_000, pytest.approx(2e-6 / 0.18))


def looks(*pairs: tuple[float, int], stiff: float = 0.0) -> list[Look]:
    """Of a run that was at times [s] after so many evaluations, twelve a step, a share of the steps being stiff."""
    return [Look(time, used, used // 12, int(stiff * used / 12)) for time, used in pairs]


def test_a_late_drop_of_the_progress_rate_is_reported_when_it_has_cost_as_much_as_all_before() -> None:
    even, late = [(0.1 * k, 100 * k) for k in range(9)], [(0.8 + 1e-6 * k, 800 + 100 * k) for k in range(1, 9)]
    assert pace(looks(*even), 500) == pytest.approx(1000.0)
    assert pace(looks(*even, *late[:7]), 500) < 1e4
    assert pace(looks(*even, *late), 500) == pytest.approx(1e8)


def test_a_hasty_start_and_a_single_impact_tell_little() -> None:
    # a microsecond is left out of the round numbers: two millionths of half a second
    start = [(0.0, 0), (1e-6, 500), (0.5, 1000), (1.0, 1500)]
    assert pace(looks(*start), 5000) == pytest.approx(1000.0, rel=1e-5)
    impact = [(0.0, 0), (0.5, 100), (0.5 + 1e-6, 1100)]
    assert pace(looks(*impact), 5000) == pytest.approx(2200.0, rel=1e-5)


def test_stability_is_looked_for_in_the_steps_of_late() -> None:
    smooth, stiff = looks((0.0, 0), (0.5, 6000)), Look(0.6, 18_000, 1500, 900)
    assert not limited_by_stability(smooth)
    assert limited_by_stability([*smooth, Look(0.55, 12_000, 1000, 450), stiff])


@pytest.mark.parametrize(
    "method, tight, delivered", [("dop853", 12_000, 1e-5), ("dop853", 90_000, 1e-4), ("radau", 12_000, 1e-4)]
)
def test_the_more_accurate_run_is_delivered_where_another_method_made_it_at_less_cost(
    method: str, tight: int, delivered: float
) -> None:
    """The other run has got only half as far, with half of these evaluations."""
    dear = Search(load_scene(RIGID), lambda scene, judges: pytest.fail("no run is needed"))
    for rtol, name, end, used in ((1e-4, "radau", 1.0, 80_000), (1e-5, method, 0.5, tight // 2)):
        dear.shown[rtol] = xr.Dataset(coords={"time": [0.0, end]}, attrs={"method": name, "evaluations": used})
    attempt = Attempt(1e-4, {"platform.velocity": 1e-3}, 0.2)
    if method == "radau":
        assert dear.cheapest(attempt) == attempt  # one method's tighter run costs less by chance only
    assert dear.cheapest(attempt).rtol == delivered
    assert dear.cheapest(replace(attempt, fraction=2.0)).rtol == 1e-4


def test_overdamped_modes_are_followed_as_those_that_ring() -> None:
    """Twice the critical damping: its two decays are both exact, so that they limit no step."""
    damped = {**SHORT, "body.rod1.damping": 2.0}
    made = simulated(load_scene(RINGING, {**damped, "solver": {"integrator": "exponential", "rtol": 1e-5}}))
    known = simulated(load_scene(RINGING, {**damped, "solver.rtol": 1e-11}))
    error = np.abs(made.velocity - known.velocity).sel(body="platform").max() / np.abs(known.velocity).max()
    assert float(error) < 1e-6  # 1.2e-8 here, of a tolerance of 1e-5 per step
    assert made.evaluations < 0.5 * known.evaluations  # 832 of 7821 here; as many as those when damping was cut


@pytest.mark.parametrize("given, chosen", [(True, True), (False, False)])
def test_it_can_be_said_in_words(given: bool, chosen: bool) -> None:
    asked = {**WANTED, "by_need": given}
    assert load_scene(RINGING, {"accuracy": asked, "solver.integrator": "dopri5"}).by_need() is chosen


@dataclass
class InParts:
    """A run that is known as a whole, for a search of tolerances; it notes how far it was asked for."""

    run: xr.Dataset
    asked: list[float] = field(default_factory=list)

    def until(self, time: float) -> LabelledArrays:
        self.asked.append(time)
        return label_dataset(self.run.sel(time=self.run["time"] <= time).drop_vars("horizon", errors="ignore"))

    def whole(self) -> LabelledArrays:
        self.asked.append(np.inf)
        return label_dataset(self.run)


def refused_below(least: float, run: xr.Dataset) -> xr.Dataset:
    """What a default search delivers of a run that looser tolerances give alike, and tighter ones not at all."""

    def once(scene: Scene, judges: object) -> InParts:
        if scene.solver.rtol < least:
            raise SolverError("the limit of evaluations is reached")
        return InParts(run)

    by_need = SimpleNamespace(best=lambda rtol: "dop853", why=lambda rtol: "", judges=lambda rtol: None)
    by_need.learn, by_need.span = lambda rtol, name, run, part: None, 1.0
    return by_default(load_scene(TREE / "scenes/checks/pendulum.toml"), once, silent, lambda scene: by_need)


def climbed(runs: dict[float, InParts], horizons: dict[float, float], chaos: float = 0.5) -> Attempt:
    """What a search finds whose runs err by 3000 times the tolerance and differ at will after `chaos`, noted in `runs`.

    horizons: by tolerance [s]; elsewhere half of the run.
    """

    def once(scene: Scene, judges: object) -> InParts:
        rtol = scene.solver.rtol
        assert rtol not in runs
        time = np.linspace(0.0, scene.time.end, 101)
        x = time * (1.0 + 3000.0 * rtol) + np.where(time > chaos, np.sin(1.0 / rtol), 0.0)
        position = (("time", "body", "axis"), x[:, None, None] * np.ones((1, 1, 3)))
        frames = (("time", "frame", "axis"), position[1])
        made = xr.Dataset({"position": position, "frame_position": frames}, {"time": time, "body": ["platform"]})
        return runs.setdefault(rtol, InParts(made.assign(horizon=horizons.get(rtol, 0.5))))

    request = {"quantities": {"platform.position": {"relative": 1e-3}}}
    return _climb(Search(load_scene(RIGID, {"time.end": 1.0, "accuracy": request}), once, predictable=True), silent)


def test_runs_are_begun_once_and_only_the_delivered_one_goes_on_beyond_the_horizon() -> None:
    """The error is 1500 times the tolerance at half of the run: 15 and 1.5 times the default request on the ladder's
    first decades, from which twice a tenth of the latter is expected on the next one."""
    runs = dict[float, InParts]()
    best = climbed(runs, {})
    assert best.rtol == 1e-7
    # of the range at 1e-5, 1 + 0.03 + sin(1e5), at the end of the only whole run
    assert best.fraction == pytest.approx(2.0 * 0.15 / (1.03 + np.sin(1e5)), rel=1e-6)
    assert {rtol: one.asked for rtol, one in runs.items()} == {
        1e-5: [np.inf], 1e-6: [0.5], 1e-7: [0.5, np.inf],
    }  # fmt: skip


def test_a_later_horizon_of_the_delivered_run_takes_no_run_at_a_tighter_tolerance() -> None:
    runs = dict[float, InParts]()
    best = climbed(runs, {1e-7: 0.55}, chaos=0.6)
    assert best.rtol == 1e-7
    assert {rtol: one.asked for rtol, one in runs.items()} == {
        1e-5: [np.inf], 1e-6: [0.5, 0.55], 1e-7: [0.5, np.inf],
    }  # fmt: skip


def test_a_horizon_that_only_the_loosest_run_has_takes_no_tighter_and_tighter_runs() -> None:
    """Beyond half of the run errors do not fall with the tolerance: the loosest run's horizon is an accident."""
    runs = dict[float, InParts]()
    best = climbed(runs, {1e-5: 0.9})
    assert best.met
    assert best.rtol == 1e-7
    assert min(runs) == 1e-7


@pytest.mark.parametrize("watched, recorded", [("rod1.position", None), ("rod1.peak_von_mises_stress", ("rod1",))])
def test_parts_of_runs_record_stresses_only_where_a_quantity_is_one(watched: str, recorded: object) -> None:
    scene = load_scene(RINGING, {"output.stress": ["rod1"], "view.watch": [watched]})
    assert scene.with_requested_output().output.stress == recorded


@pytest.mark.parametrize("last, expected", [(1.5, 2.0 * 0.1 * 1.5), (4.6, None), (0.1, 2.0 * 0.1 * 0.1)])
def test_an_error_is_extrapolated_where_it_falls_and_meets_the_request(last: float, expected: float | None) -> None:
    search = Search(load_scene(RIGID, {"accuracy": WANTED}), lambda scene, judges: pytest.fail("no run is needed"))
    attempts = [Attempt(10.0**-k, {"platform.velocity": f}, f) for k, f in ((4, 15.0), (5, last))]
    made = search.extrapolated(1e-6, attempts)
    assert (made and made.fraction) == (expected and pytest.approx(expected))
    assert search.extrapolated(1e-7, attempts) is None  # no neighbour
    assert search.extrapolated(1e-6, attempts[1:]) is None


def test_a_run_that_none_can_be_compared_with_is_delivered_with_an_unknown_error() -> None:
    run = simulated(load_scene(TREE / "scenes/checks/pendulum.toml", {"solver.rtol": 1e-6}))
    delivered = refused_below(1e-5, run)
    assert delivered.attrs["accuracy_verdict"].startswith("not verified: ")
    assert np.array_equal(delivered["position"].values, run.position.values)
    with pytest.raises(SolverError, match="is reached"):
        refused_below(1.0, run)
