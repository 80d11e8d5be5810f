"""Scenes that ask for accuracy and name no integrator: which one is chosen, why, and what becomes of a wrong guess."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline import dynamics, load_scene
from flexclear.pipeline.core import quantities
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.scene.wanted import parse
from flexclear.pipeline.dynamics.effects import schemes
from flexclear.pipeline.dynamics.run.suited import Rates, Suit
from tests.analytic.mechanism_runs import TREE, bundles

RINGING = TREE / "scenes" / "sps4" / "far_cb.toml"
RIGID = TREE / "scenes" / "sps4" / "csj.toml"
#: a part of the stroke, with a hundred periods of the rod's slowest vibration but one
SHORT = {"time.end": "20 ms", "output.interval": "1 ms"}
WANTED = {"platform.velocity": "0.1 %"}


def simulated(scene: Scene, told: list[str] | None = None) -> xr.Dataset:
    said = [] if told is None else told
    return dynamics.simulate(scene, bundles(scene), lambda share, text: said.append(text) if share is None else None)


@cache
def reference() -> xr.Dataset:
    """The ringing rod, by explicit steps at a tight tolerance."""
    return simulated(load_scene(RINGING, {**SHORT, "solver.rtol": 1e-11}))


def test_ringing_modes_get_the_method_that_follows_them() -> None:
    told: list[str] = []
    scene = load_scene(RINGING, {**SHORT, "accuracy": WANTED})
    run = simulated(scene, told)
    assert run.attrs["method"] == "exponential"
    assert "the modes' fastest vibration" in run.attrs["method_reason"]
    assert run.attrs["method_reason"] in told
    velocity = parse("platform.velocity", scene.owners())
    error = quantities.error(run, reference(), velocity) / quantities.scale(reference(), velocity)
    assert run.attrs["accuracy_verdict"] == "met"
    assert error < 3e-3  # what is wanted, and the estimate's own doubt, as in test_accuracy
    # an explicit method is stable with 140 evaluations per millisecond; here some 25 are taken
    assert run.attrs["evaluations"] < 0.5 * reference().attrs["evaluations"]


def test_a_stiff_choice_by_hand_stays() -> None:
    scene = load_scene(RINGING, {**SHORT, "accuracy": WANTED, "solver.integrator": "dop853"})
    assert not scene.by_need()
    assert [scheme.integrator for scheme in schemes(scene)] == ["dop853", "radau"]


def test_rigid_bodies_get_the_explicit_method() -> None:
    scene = load_scene(RIGID, {**SHORT, "accuracy": {"platform.velocity": "1 %"}})
    run = simulated(scene)
    assert run.attrs["method"] == "dop853"
    assert "evaluations for dop853 to be stable" in run.attrs["method_reason"]
    assert [scheme.integrator for scheme in schemes(scene)] == ["dop853", "radau"]


def test_tighter_tolerances_give_smaller_errors_where_modes_ring() -> None:
    errors = []
    for rtol in (1e-4, 1e-6, 1e-8):
        run = simulated(load_scene(RINGING, {**SHORT, "solver": {"integrator": "exponential", "rtol": rtol}}))
        errors.append(float(np.abs(run.velocity - reference().velocity).sel(body="platform").max()))
    # error per step by an estimate of fourth order, of a method of order 6: at least by 100^(4/5) per hundredth
    assert errors[1] < errors[0] / 4.0
    assert errors[2] < errors[1] / 4.0


def known(**seen: tuple[float, float]) -> Suit:
    return Suit(Rates(6e4, 20.0), 0.18, ("dop853", "exponential", "radau"), dict(seen))


def test_what_a_run_took_decides_about_the_next() -> None:
    """An explicit method takes 26 000 evaluations here whatever the tolerance, up to where accuracy limits it."""
    assert known().best(1e-4) == "exponential"
    assert known(exponential=(1e-4, 400.0)).best(1e-6) == "exponential"
    assert known(exponential=(1e-4, 400.0)).best(1e-14) == "dop853"
    # where contacts set its steps, it is the dearer one
    assert known(exponential=(1e-4, 3e4)).best(1e-4) == "dop853"


def test_two_runs_tell_how_evaluations_grow_with_the_tolerance() -> None:
    """Those of contacts hardly do: where they are most of them, the estimate's order says little."""
    suit = Suit(Rates(6e4, 20.0), 0.18, ("dop853", "exponential", "radau"), touching=True)
    suit.learn(1e-3, "exponential", xr.Dataset(attrs={"method": "exponential", "evaluations": 20_000}))
    assert suit.best(1e-6) == "dop853"
    suit.learn(1e-5, "exponential", xr.Dataset(attrs={"method": "exponential", "evaluations": 21_000}))
    assert suit.best(1e-6) == "exponential"
    assert suit.best(1e-14) == "dop853"


def test_a_guess_that_runs_correct_is_not_repeated() -> None:
    suit = known()
    suit.learn(1e-4, "exponential", xr.Dataset(attrs={"method": "dop853", "evaluations": 1}))
    assert suit.best(1e-4) == "dop853"
    assert "began with exponential" in suit.why(1e-4)
    suit.learn(1e-4, "dop853", xr.Dataset(attrs={"method": "radau", "evaluations": 1}))
    assert suit.best(1e-4) == "radau"
    assert "stability limited the steps of dop853 in a run before" in suit.why(1e-4)


@pytest.mark.parametrize("given, chosen", [(True, True), (False, False)])
def test_it_can_be_said_in_words(given: bool, chosen: bool) -> None:
    asked = {**WANTED, "by_need": given}
    assert load_scene(RINGING, {"accuracy": asked, "solver.integrator": "dopri5"}).by_need() is chosen
