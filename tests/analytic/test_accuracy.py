"""Runs whose accuracy the scene asks for: what is delivered, against a run at the tightest tolerance."""

import json
from contextlib import suppress

import pytest

from flexclear import dynamics, load_scene
from flexclear.artifacts import quantities
from flexclear.scene.quantity import parse
from flexclear.system.errors import InputError, SolverError
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import simulated

CSJ = TREE / "scenes" / "sps4" / "csj.toml"
FULL = TREE / "scenes" / "sps4" / "far_csj_cb.toml"
IDEAL = TREE / "scenes" / "sps4" / "ideal.toml"
#: what the reference's own rounding changes the platform's velocity by [m/s]
ROUNDING = 4e-10


def quiet(fraction, text):
    """Nobody watches."""


@pytest.fixture(scope="module")
def reference():
    return simulated(load_scene(CSJ, {"solver.rtol": 1e-14}))


@pytest.mark.parametrize("requested", [10.0**-k for k in (2, 3, 5, 7, 9)])
def test_the_delivered_error_is_the_requested_one(reference, requested):
    scene = load_scene(CSJ, {"accuracy": {"platform": {"velocity": {"relative": requested}}}})
    run = dynamics.simulate(scene, {}, quiet)
    velocity = parse("platform.velocity", scene.owners())
    size = quantities.scale(reference, velocity)
    delivered = quantities.largest_distance(run, reference, velocity) / size
    assert run.attrs["accuracy_verdict"] == "met"
    # a run is accepted whose estimate is at most that; estimates are good to some per cent, and at 1e-9 the
    # reference's own rounding is as large as what is compared
    assert delivered < 3.0 * requested
    # nor is it too dear: errors jump from tolerance to tolerance, as impacts do, but a ten times looser one misses, or
    # its energy is refused
    with suppress(SolverError):
        looser = simulated(load_scene(CSJ, {"solver.rtol": 10.0 * run.attrs["accuracy_rtol"]}))
        assert (quantities.largest_distance(looser, reference, velocity) + ROUNDING) / size > requested


def test_several_quantities_are_met_together(reference):
    asked = {"A1.impact_times": "1 us", "platform.position": "0.1 um"}
    scene = load_scene(CSJ, {"accuracy": asked})
    run = dynamics.simulate(scene, {}, quiet)
    for name, limit in (("A1.impact_times", 1e-6), ("platform.position", 1e-7)):
        quantity = parse(name, scene.owners())
        assert quantities.largest_distance(run, reference, quantity) < 3.0 * limit
    assert float(json.loads(run.attrs["accuracy_estimated"])["A1.impact_times"]) <= 1e-6


def test_what_cannot_be_had_is_said_with_the_best_there_is(reference):
    # a third of the stroke, at whose times the reference is known as well
    scene = load_scene(CSJ, {"time.end": "60 ms", "accuracy": {"platform.velocity": {"relative": 1e-15}}})
    run = dynamics.simulate(scene, {}, quiet)
    assert "times the requested accuracy" in run.attrs["accuracy_verdict"]
    velocity = parse("platform.velocity", scene.owners())
    assert quantities.largest_distance(run, reference, velocity) < 1e-8 * quantities.scale(reference, velocity)


@pytest.mark.slow
def test_of_a_chaotic_run_it_is_said_how_long_it_can_be_had():
    """With an undamped flexible rod next to the clearance, motions part so fast that no tolerance holds to the end."""
    scene = load_scene(FULL, {"accuracy": {"platform.velocity": {"relative": 1e-8}}})
    verdict = dynamics.simulate(scene, bundles(scene), quiet).attrs["accuracy_verdict"]
    assert "times the requested accuracy" in verdict
    assert "tighter tolerances do not help (it holds until t = " in verdict
    assert "chaotic or rounding decides" in verdict


@pytest.mark.parametrize(
    "asked, reported",
    [
        ({"platform.peak_force": "1 N"}, "known: A1.peak_force"),
        ({"platform.position": {"relative": 2.0}}, "less than 1"),
        ({"platform.position": -1.0}, "greater than 0"),
    ],
)
def test_wrong_wishes_are_refused_before_any_work(asked, reported):
    with pytest.raises(InputError, match=reported):
        load_scene(CSJ, {"accuracy": asked})


def test_a_share_of_nothing_is_refused():
    still = {"drive.P1.law": {"type": "constant"}, "drive.P2.law": {"type": "constant"}}
    scene = load_scene(IDEAL, {"accuracy": {"platform.velocity": "1 %"}, **still})
    with pytest.raises(InputError, match="quantity is constant"):
        dynamics.simulate(scene, {}, quiet)
