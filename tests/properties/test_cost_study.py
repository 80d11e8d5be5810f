"""The price list of a scene, from made-up runs whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from benchmarks.families import accuracy
from flexclear.artifacts import quantities
from flexclear.post.cost import study as cost_study
from flexclear.post.cost import work_precision
from flexclear.post.cost.study import MeasuredRun, assemble, is_resolved
from flexclear.scene.quantity import Quantity
from flexclear.system.errors import SolverError

POSITION = Quantity("slider", "position")
TIMES = Quantity("pin", "impact_times")
SIZE = 2.0  # largest displacement of the made-up slider [m]


def run(error: float, *, seconds=(0.2, 0.1, 0.3), evaluations=100, impacts=3, horizon=None) -> xr.Dataset:
    """A slider that goes 2 m, off by `error`; with impacts off by `error` seconds."""
    time = np.linspace(0.0, 1.0, 11)
    position = np.zeros((11, 1, 3))
    position[:, 0, 0] = SIZE * time + error * np.sin(np.pi * time)
    data = {
        "position": (("time", "body", "axis"), position),
        "event_time": (("event",), 0.2 * (1 + np.arange(impacts)) + error),
        "event_contact": (("event",), np.full(impacts, "pin")),
        "event_kind": (("event",), np.full(impacts, "closing")),
        "event_approach_speed": (("event",), np.full(impacts, 0.5)),
        "cpu_repeat": (("repeat",), np.array(seconds)),
    }
    if horizon is not None:
        data["horizon"] = ((), horizon)
    coordinates = {"time": time, "body": ["slider"], "contact": ["pin"]}
    attributes = {
        "evaluations": evaluations,
        "compile_seconds": 1.0,
        "peak_memory": 1e8,
        "recording_seconds": 0.15,
    }
    return xr.Dataset(data, coordinates, attributes)


REFUSED = xr.Dataset(attrs={"refused": "it blew up; take another"})


def study(uncertainty: float = 1e-8, horizon: float | None = None, **changed: xr.Dataset):
    """dop853 at four tolerances, of which the tightest is the reference, radau, which confirms it, and rk4 at two steps
    of which one is refused; some runs changed."""
    points = [MeasuredRun("best", "dop853", rtol=1e-12), MeasuredRun("other", "radau", rtol=1e-9)]
    runs = {"best": run(0.0, horizon=horizon, evaluations=1000), "other": run(uncertainty, evaluations=1000)}
    for k, (rtol, error) in enumerate(((1e-3, 1e-2), (1e-6, 1e-5), (1e-9, 1e-7))):
        points.append(MeasuredRun(f"d{k}", "dop853", rtol=rtol))
        runs[f"d{k}"] = run(error, evaluations=100 * (k + 1))
    for name, step, made in (("fine", 1e-3, run(1e-4, evaluations=50)), ("coarse", 1e-2, REFUSED)):
        points.append(MeasuredRun(name, "rk4", step=step))
        runs[name] = made
    runs |= changed
    return assemble(points, runs, [POSITION, TIMES]), points, runs


@pytest.fixture(scope="module")
def found() -> xr.Dataset:
    return study()[0]


def test_errors_are_relative_to_the_size_of_the_quantity(found: xr.Dataset):
    error = found["error"].sel(run="d1")
    assert float(error.sel(quantity="slider.position")) == pytest.approx(1e-5 / SIZE)
    assert float(error.sel(quantity="pin.impact_times")) == pytest.approx(1e-5 / 0.6)  # last impact at 0.6 s


def test_costs_are_medians_with_their_spread(found: xr.Dataset):
    assert float(found["cpu_seconds"].sel(run="d0")) == 0.2
    assert float(found["cpu_spread"].sel(run="d0")) == pytest.approx(0.2)


def test_refused_points_are_gaps_with_their_reason(found: xr.Dataset):
    assert np.isnan(found["error"].sel(run="coarse")).all()
    assert "it blew up" in found.attrs["refused"]
    assert "take another" not in found.attrs["refused"]


def test_errors_near_that_of_the_reference_are_not_resolved():
    found, *_ = study(uncertainty=1e-7)
    reported = is_resolved(found).sel(quantity="slider.position")
    assert reported.sel(run="d1").item()
    assert not reported.sel(run="d2").item()


def test_errors_beyond_the_horizon_do_not_count():
    all_of_it, *_ = study()
    part, *_ = study(horizon=0.2)
    pick = {"run": "d0", "quantity": "slider.position"}
    ratio = float(part["error"].sel(pick)) / float(all_of_it["error"].sel(pick))
    assert ratio == pytest.approx(np.sin(0.2 * np.pi))


def test_the_horizon_of_the_confirmation_counts_too():
    """An impact that only one of both has, beyond what the confirmation can predict, is no uncertainty."""
    later, *_ = study(horizon=0.7, other=run(1e-8, impacts=2))
    sooner, *_ = study(horizon=0.7, other=run(1e-8, impacts=2, horizon=0.5))
    assert np.isinf(later.reference_uncertainty.sel(quantity=TIMES.name))
    assert sooner.attrs["horizon"] == 0.5
    assert float(sooner.reference_uncertainty.sel(quantity=TIMES.name)) < 1e-7


def test_a_reference_that_is_not_confirmed_is_drawn_as_one():
    found, *_ = study(other=run(1e-8, impacts=2))
    assert set(work_precision.make("w", found, "t")) == {"w.png", "w.svg"}


def test_a_different_number_of_impacts_is_an_infinite_error_and_never_the_cheapest():
    found, *_ = study(d2=run(0.0, impacts=2, evaluations=1))
    assert np.isinf(found["error"].sel(run="d2", quantity="pin.impact_times"))
    chosen = cost_study.cheapest(found, 1e-3)
    assert chosen is not None
    assert chosen.evaluations > 1


def test_the_cheapest_way_to_each_accuracy(found: xr.Dataset):
    assert cost_study.cheapest(found, 1e-3).name == "fine"
    assert cost_study.cheapest(found, 1e-4).name == "d1"
    assert cost_study.cheapest(found, 1e-12) is None
    rows = cost_study.price_list(found, "t").rows
    assert rows[2][1] == "cannot be reached"
    # of the reference itself the 1e-8 s of 0.6 s by which it and its confirmation differ
    assert "1.7e-08 at best" in rows[2][4]


def test_an_error_below_the_references_uncertainty_is_not_claimed():
    found, *_ = study(uncertainty=1e-5)
    assert cost_study.cheapest(found, 1e-6) is None


def test_a_study_whose_runs_but_one_are_refused_is_not_confirmed():
    found, *_ = study(**dict.fromkeys(("other", "d0", "d1", "d2", "fine", "coarse"), REFUSED))
    assert any("Not confirmed: there is no second run" in note for note in cost_study.price_list(found, "t").notes)


def test_a_study_without_a_run_that_can_be_its_reference_is_refused_with_the_reason():
    with pytest.raises(SolverError, match="no reference exists: it blew up"):
        study(**dict.fromkeys(("best", "other", "d0", "d1", "d2"), REFUSED))


def test_a_run_that_no_other_confirms_has_an_unknown_error_and_none_is_cheaper():
    runs = {cost_study.OWN: run(0.0), "same": run(0.0)}
    found = assemble([MeasuredRun("same", "dop853", rtol=1e-7)], runs, [POSITION])
    found.attrs |= {"own_integrator": "dop853", "own_rtol": 1e-7, "own_seconds": 0.4, "own_evaluations": 5e4}
    text = cost_study.sentences(found)
    assert text.endswith("(50000 evaluations). The integration's error is unknown: no other run is known.")
    assert cost_study.cheapest(found, 1e-3) is None
    assert all("inf at best" in row for row in cost_study.price_list(found, "t").rows)


def test_the_pareto_front_holds_what_nothing_beats():
    seconds, error = np.array([1.0, 2.0, 3.0, 4.0, np.nan]), np.array([1e-2, 1e-1, 1e-4, 1e-3, 1e-9])
    assert work_precision.pareto(seconds, error).tolist() == [0, 2]


def test_the_least_time_decides_and_evaluations_only_where_times_are_alike(found: xr.Dataset):
    assert cost_study.cheapest(found, 1e-3).name == "fine"
    slow, *_ = study(fine=run(1e-4, evaluations=50, seconds=(0.3, 0.3, 0.3)))  # of dop853: 200 in 0.2 s
    assert cost_study.cheapest(slow, 1e-3).name == "d1"


def test_contacts_beyond_the_horizon_do_not_count():
    """Peaks and impulses, too, are those of contacts up to the horizon."""
    a, b = run(0.0), run(0.0)
    for one, last in ((a, 50.0), (b, 80.0)):
        one["event_peak_force"] = (("event",), [10.0, 20.0, last])  # at 0.2, 0.4 and 0.6 s
        grown = np.array([1.0] * 5 + [last] * 6)  # every 0.1 s
        one["contact_impulse"] = (("time", "contact"), grown[:, None])
    for kind in ("peak_force", "impulse"):
        quantity = Quantity("pin", kind)
        assert quantities.largest_distance(a, b, quantity) == 30.0
        assert quantities.largest_distance(a, b, quantity, until=0.45) == 0.0


def test_the_answer_has_the_time_and_the_error_up_to_the_horizon():
    found, *_ = study(horizon=0.5)
    found.attrs |= {"own_rtol": 1e-9, "own_integrator": "dop853", "own_seconds": 0.2, "own_evaluations": 2e3}
    found["own_error"] = (("quantity",), np.full(found.sizes["quantity"], 1e-6))
    text = cost_study.sentences(found)
    assert "the integration takes 0.2 s of processor time (2000 evaluations)" in text
    assert "errs at the outputs up to the horizon, t = 0.5 s, by 1.0e-06 of" in text


def test_other_programs_are_drawn_next_to_ours_relative_to_the_same_size(found: xr.Dataset):
    track = {"name": "peer", "seconds": [1.0, 2.0], "error": {"slider.position": [1e-3, 1e-4]}}
    (curve,) = accuracy.curves_of(found, [track])
    assert curve.error[:, 0] == pytest.approx([1e-3 / SIZE, 1e-4 / SIZE])
    assert np.isnan(curve.error[:, 1]).all()  # it says nothing of impact times
    own = xr.Dataset({"own_error": found["error"].sel(run="d1")})
    drawn = work_precision.make("w", found.merge(own, compat="override").assign_attrs(own_seconds=0.5), "t", [curve])
    assert set(drawn) == {"w.png", "w.svg"}
    assert drawn["w.svg"].decode().count("<!-- this scene -->") == 2


def test_runs_left_undone_are_named_with_their_reason():
    study = xr.Dataset(attrs={"undone": "rk4, step 1e-06 s"})
    assert cost_study.skipped_sentence(study) == ["Not run within the budget: rk4, step 1e-06 s."]
    assert cost_study.skipped_sentence(study.assign_attrs(undone="")) == []
