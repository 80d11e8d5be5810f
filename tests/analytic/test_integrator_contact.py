"""Contacts under every integrator: a bouncing ball against one dimension, the mechanism against itself."""

from functools import cache

import numpy as np
import pytest
import xarray as xr

from flexclear import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE, Overrides, bundles, impacts, run
from tests.properties.mechanisms import simulated
from tests.reference import contact_solutions as exact

BOUNCE, CSJ = "checks/bounce", "sps4/csj"
STEP = 1e-5
#: late contacts make energy, which these runs are made to show
LATE = {"events": "at step ends", "ledger_tolerance": 1.0}


def solver(**keys: object) -> Overrides:
    return tuple((f"solver.{key}", value) for key, value in keys.items())


#: solver -> largest error of the six impact times [s] and speeds [m/s]; the ball bounces for a second
BOUNCES = {
    "dopri5": (solver(integrator="dopri5", rtol=1e-10), 5e-8, 5e-8),
    # third-order dense output is not used where a step is repeated to end on the event
    "radau": (solver(integrator="radau", rtol=1e-10), 1e-7, 1e-7),
    # the contact's stiffness is followed exactly, its change with the depth by a cubic
    "exponential": (solver(integrator="exponential", rtol=1e-10), 1e-7, 1e-7),
    # second order: the error per step is rtol, the number of steps goes with its cube root
    "generalized-alpha": (solver(integrator="generalized-alpha", rtol=1e-9), 1e-5, 1e-5),
    # 200 steps a contact of 2 ms, each begun anew: (step / contact time)^4 of a second's flight
    "rk4": (solver(integrator="rk4", step=STEP), 1e-6, 1e-6),
    "adams-bashforth-moulton": (solver(integrator="adams-bashforth-moulton", step=STEP), 1e-6, 1e-6),
    # order 5, 200 steps a contact
    "radau fixed": (solver(integrator="radau", step=STEP), 1e-7, 1e-7),
    "generalized-alpha fixed": (solver(integrator="generalized-alpha", step=STEP), 1e-4, 1e-4),
}
QUICK = ("dopri5", "radau", "exponential")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in BOUNCES])
def test_ball_bounces_as_in_one_dimension(name: str) -> None:
    overrides, times, speeds = BOUNCES[name]
    found = impacts(run(BOUNCE, overrides))
    known = exact.bounces(1.0, 1e8, 0.7, 9.81, 0.1, 0.99)
    assert found["start"] == pytest.approx([b.start for b in known], abs=times)
    assert found["approach"] == pytest.approx([b.approach for b in known], abs=speeds)
    assert found["separation"] == pytest.approx([b.separation for b in known], abs=speeds)


@pytest.mark.slow
def test_unlocated_events_lie_on_the_grid_and_latch_the_speed_there() -> None:
    found = impacts(run(BOUNCE, solver(integrator="rk4", step=1e-4, **LATE)))
    start, known = found["start"][0], exact.bounces(1.0, 1e8, 0.7, 9.81, 0.1, 0.2)[0]
    assert start / 1e-4 == pytest.approx(round(start / 1e-4), abs=1e-6)
    assert 0.0 < start - known.start <= 1e-4
    # until the step's end the ball falls on freely
    assert found["approach"][0] == pytest.approx(known.approach + 9.81 * (start - known.start), rel=1e-9)


@pytest.mark.slow
def test_the_papers_predictor_corrector_without_location_finds_other_impacts() -> None:
    """At the paper's step of 1e-5 s: some mm/s off, and more impacts than there are."""
    paper = run(CSJ, solver(integrator="adams-bashforth-moulton", step=STEP, **LATE))
    known = run(CSJ, solver(rtol=1e-12))
    assert len(impacts(paper)["start"]) != len(impacts(known)["start"])
    times = np.round(np.arange(0.0, 0.18, 1e-3), 9)
    speeds = [d.sel(body="platform").sel(time=times, method="nearest").velocity.values for d in (paper, known)]
    assert 1e-3 < np.abs(speeds[0] - speeds[1]).max() < 2e-2


# A rod that rings in a lasting contact: `exponential` follows modes exactly and the contact by steps ----------------

#: sixteen impacts in 23 ms, then a contact that lasts, in which ball and rod vibrate at some 4 kHz
PRESSED = TREE / "scenes" / "sps4" / "variants" / "far_csj_cb_damped.toml"
SHORT = {"time.end": "30 ms", "output.interval": "1 ms"}


def without_friction(scene: Scene) -> Scene:
    loose = {name: joint.model_copy(update={"friction": None}) for name, joint in scene.joint.items() if name == "A1"}
    return scene.model_copy(update={"joint": scene.joint | loose})


@cache
def pressed_run(integrator: str, rtol: float) -> xr.Dataset:
    solver = {"integrator": integrator, "rtol": rtol}
    scene = without_friction(load_scene(PRESSED, {**SHORT, "solver": solver}))
    return simulated(scene, bundles(scene))


def velocity_error(integrator: str, rtol: float) -> float:
    """Largest error of the platform's velocity at the outputs, as a share of the largest velocity."""
    made, known = (
        one.velocity.sel(body="platform").values[np.searchsorted(one.time, 1e-3 * np.arange(31) - 1e-9)]
        for one in (pressed_run(integrator, rtol), pressed_run("dop853", 1e-12))
    )
    return float(np.abs(made - known).max() / np.abs(known).max())


def test_tighter_tolerances_give_smaller_errors_in_contact() -> None:
    errors = [velocity_error("exponential", rtol) for rtol in (1e-5, 1e-7, 1e-9)]
    # an estimate of fourth order: by 100^(4/5) per hundredth, which impacts magnify by chance
    assert errors[1] < errors[0] / 4.0
    assert errors[2] < errors[1] / 4.0
    assert errors[2] < 1e-5


def test_impacts_are_those_of_the_explicit_method() -> None:
    made, known = impacts(pressed_run("exponential", 1e-9), 1e-2), impacts(pressed_run("dop853", 1e-12), 1e-2)
    # a velocity error of 1e-6 that sixteen impacts have magnified
    assert np.allclose(made["start"], known["start"], rtol=0.0, atol=1e-7)
    assert np.allclose(made["peak_force"], known["peak_force"], rtol=1e-4)
