"""Every integrator has the order that it claims; explicit methods that crawl are replaced, implicit ones go on."""

from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.dynamics.run import progress_rate, trajectory
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.scene.integrators import INTEGRATORS
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.integrator_scenes import (
    NO_PROJECTION,
    SCENES,
    double_pendulum,
    engine_with,
    ledger_free,
    reference,
)
from tests.analytic.integrator_scenes import trajectory as integrated
from tests.analytic.mechanism_runs import TREE

#: integrator -> order, order of its dense output's error, steps per second at which errors are neither coarse nor
#: rounding, tolerance of Newton's iterations
CASES: dict[str, tuple[int, int, tuple[int, ...], float]] = {
    "dop853": (8, 8, (20, 24, 28, 32), NO_PROJECTION),
    "dopri5": (5, 5, (160, 240, 320), NO_PROJECTION),
    "rk4": (4, 4, (80, 160, 320), NO_PROJECTION),
    "adams-bashforth-moulton": (4, 4, (1280, 1920, 2560), NO_PROJECTION),
    "generalized-alpha": (2, 2, (200, 400, 800), 1e-6),
    "radau": (5, 4, (20, 40, 80), 1e-11),
    "exponential": (6, 5, (20, 28, 40), 1e-12),
}
MECHANISMS = ["double pendulum", pytest.param("spatial four-bar", marks=pytest.mark.slow)]


def slope(steps: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def errors(name: str, integrator: str) -> tuple[list[float], list[float], list[float]]:
    """Steps, errors at the end and largest errors between step ends, all against DOP853 at 1e-13."""
    known, (_, _, per_second, rtol) = reference(name), CASES[integrator]
    steps = [1.0 / k for k in per_second]
    ends, dense = [], []
    for step in steps:
        made = integrated(SCENES[name](), {"integrator": integrator, "step": step, "rtol": rtol})
        error = np.abs(ledger_free(made.rows) - ledger_free(known)).max(axis=1)
        ends.append(float(error[-1]))
        dense.append(float(np.sqrt(np.mean(error[:-1] ** 2))))
    return steps, ends, dense


def test_every_integrator_is_measured() -> None:
    assert {name: order for name, (order, *_) in CASES.items()} == {n: t.order for n, t in INTEGRATORS.items()}


@pytest.mark.parametrize("integrator", CASES)
@pytest.mark.parametrize("name", MECHANISMS)
def test_order_is_as_claimed(name: str, integrator: str) -> None:
    steps, ends, dense = errors(name, integrator)
    order, between, *_ = CASES[integrator]
    # at finite steps the next term of the error is there, too: it turns the slope by 0.14 at most, the next order by 1
    assert slope(steps, ends) == pytest.approx(order, abs=0.25)
    # output times fall differently into the steps of each run, which scatters the error between them
    assert slope(steps, dense) == pytest.approx(between, abs=0.6)


#: integrator -> error that rtol 1e-7 leaves at most: some ten steps, through a motion that doubles errors a few times;
#: of second order, a thousand steps, at speeds of some 10 rad/s
TOLERANCES = {"dop853": 1e-5, "dopri5": 1e-5, "radau": 1e-5, "generalized-alpha": 1e-3, "exponential": 1e-5}


@pytest.mark.parametrize("integrator", TOLERANCES)
def test_tighter_tolerances_give_smaller_errors(integrator: str) -> None:
    known, found = reference("double pendulum"), []
    for rtol in (1e-5, 1e-7, 1e-9):
        made = integrated(SCENES["double pendulum"](), {"integrator": integrator, "rtol": rtol})
        found.append(np.abs(ledger_free(made.rows) - ledger_free(known)).max())
    # a hundredth of the tolerance: error per step of second order with a third-order estimate falls by 100^(2/3)
    assert found[1] <= found[0] / 15.0
    assert found[2] <= found[1] / 15.0
    assert found[1] <= TOLERANCES[integrator]


# Another program ----------------------------------------------------------------------------------------------------


def test_radau_goes_where_scipys_goes() -> None:
    scene = Scene.model_validate({**double_pendulum(), "solver": {"integrator": "radau"}})
    engine = engine_with(scene)
    start = consistent_start(engine)
    engine.select_pieces_after(0.5)
    known = solve_ivp(
        lambda t, y: closure_rows.evaluate(engine, y, t),
        (engine.start, engine.end),
        start,
        "Radau",
        rtol=1e-10,
        atol=1e-10,
    )
    made = integrated(double_pendulum(), {"integrator": "radau", "rtol": 1e-10})
    # both leave some hundred steps of rtol, with different norms
    assert ledger_free(made.rows)[-1] == pytest.approx(known.y[:-2, -1], abs=1e-7)
    # a like number of steps: the estimate and its control are the same method's
    assert 0.3 < made.counters["steps"] / len(known.t) < 3.0
    assert made.counters["jacobians"] <= np.ceil(0.5 * made.counters["steps"])


# Explicit methods that crawl are noticed and replaced, fixed steps are reported --------------------------------------

ROLLING, END = "checks/socket_rolling.toml", "3 ms"
#: evaluations after which a run is looked at, and more than which in all would be hopeless; dop853 takes 3000
LOOK, HOPELESS = 1000, 1100
#: members that start so near to each other stay in touch with the wall, as the scene's ball is
CLOSE = {"members": 2, "perturbation": "1e-12 m"}


def run(reported: list[str] | None = None, end: str = END, **solver: object) -> xr.Dataset:
    """The first milliseconds; its progress reports are appended to `reported`."""
    changes = {"time.end": end} | {f"solver.{key}": value for key, value in solver.items()}
    scene = load_scene(TREE / "scenes" / ROLLING, override=changes)
    said = [] if reported is None else reported
    return dynamics.simulate(scene, {}, lambda fraction, text: said.append(text) if fraction is None else None)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Crawling is looked for early, so that a short run shows what otherwise takes millions of evaluations."""
    monkeypatch.setattr(trajectory, "SLICE", 200)
    monkeypatch.setattr(progress_rate, "TRIAL", LOOK)
    monkeypatch.setattr(progress_rate, "HOPELESS", HOPELESS)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("integrator, rtol", [("dop853", 1e-10), ("dopri5", 1e-6)])
def test_an_explicit_method_that_crawls_hands_over_where_it_is(integrator: str, rtol: float) -> None:
    """At tolerances that stability, not accuracy, makes dear."""
    reported: list[str] = []
    made, known = run(reported, integrator=integrator, rtol=rtol), run(integrator="radau", rtol=rtol)
    assert made.attrs["method"] == "radau"
    assert "limited by stability" in made.attrs["switched"]
    assert any("continuing with radau" in text for text in reported)
    # what the explicit method did is part of the run: its steps and its rows
    assert made.attrs["stiff_steps"] > 0
    assert known.attrs["stiff_steps"] == 0
    assert made.attrs["evaluations"] > LOOK
    assert np.array_equal(made.time, known.time)
    # the contact that it had begun goes on, with its impact rate
    assert made.event_kind.values.tolist() == known.event_kind.values.tolist()
    assert made.event_time.values == pytest.approx(known.event_time.values, abs=1e-9)
    # some hundred steps, each good to rtol of the way, 3 um, and of the energy that is turned over
    assert float(abs(made.position - known.position).max()) < 100.0 * rtol * 3e-6
    assert float(abs(made.energy_error).max()) < 100.0 * rtol * np.ptp(known.potential.values)


@pytest.mark.usefixtures("impatient")
def test_the_limit_of_evaluations_makes_it_hand_over_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that could not end within its limit is not followed up to it."""
    monkeypatch.setattr(progress_rate, "HOPELESS", 10_000_000)
    assert "switched" not in run().attrs
    assert "switched" in run(evaluations=2500).attrs


@pytest.mark.usefixtures("impatient")
def test_nothing_is_handed_over_where_the_motion_is_not_stiff() -> None:
    scene = load_scene(TREE / "scenes" / "checks" / "socket_preload.toml", override={"time.end": END})
    assert "switched" not in dynamics.simulate(scene, {}, lambda fraction, text: None).attrs


@pytest.mark.usefixtures("impatient")
def test_members_of_an_ensemble_hand_over_too() -> None:
    scene = load_scene(TREE / "scenes" / ROLLING, override={"time.end": END, "ensemble": CLOSE})
    found = analyses.ensemble(scene, {}, lambda fraction, text: None)
    assert found.attrs["switched"].startswith("2 of 2 members")
    assert np.isfinite(found.position.values).all()
    # at 19 Hz a distance does not grow in 3 ms, but the ball chatters on the contact's two kilohertz
    assert float(found.position.std("member").max()) < 1e-10


@pytest.mark.parametrize("step, stable", [("1e-5 s", False), ("1e-6 s", True)])
def test_a_fixed_step_beyond_stability_is_reported(step: str, stable: bool) -> None:
    """The slope of friction has some 4e5 1/s here, and rk4 is stable up to 2.785 over the step."""
    made = run(integrator="rk4", step=step, end="0.3 ms")
    assert ("too long for rk4 to be stable" in made.attrs["warnings"]) is not stable
    assert (made.attrs["stiff_steps"] > 0) is not stable
    assert "switched" not in made.attrs


# A mode a thousand times faster than the motion ---------------------------------------------------------------------

STIFFNESS, DAMPING, STEP = 1e6, 400.0, 2e-3
#: torque over stiffness is some 1e-5 rad; the rest is the second-order method's error at 600 steps
NEARLY_RIGID = 1e-4


def stiff_pendulum() -> dict[str, Any]:
    """The double pendulum with its second hinge held by a spring: rates of 4500 1/s under a swing of some 1 Hz.

    Damped to about its critical share: what is not damped, an accurate method has to follow.
    """
    table = double_pendulum()
    spring = {"type": "joint-spring", "joint": "Q", "stiffness": STIFFNESS, "damping": DAMPING}
    table["load"] = {**table["load"], "spring": spring}
    return table


def rigid_pendulum() -> dict[str, Any]:
    table = double_pendulum()
    table["joint"]["Q"] = {**table["joint"]["Q"], "type": "fixed"}
    return table


@pytest.mark.slow
@pytest.mark.parametrize("solver", [{"integrator": "generalized-alpha", "step": STEP}, {"integrator": "radau"}])
def test_implicit_methods_step_over_a_stiff_mode(solver: dict[str, Any]) -> None:
    made = integrated(stiff_pendulum(), {"rtol": 1e-6, **solver})
    known = integrated(rigid_pendulum(), {"rtol": 1e-12})
    angle = np.unwrap(made.rows[:, 1:3], axis=0)
    # the hinge that is held hardly gives way; the other swings as the rigid pendulum does
    first = np.argmax(np.ptp(angle, axis=0))
    assert np.abs(angle[:, 1 - first]).max() < NEARLY_RIGID
    assert np.abs(angle[:, first] - known.rows[:, 1]).max() < NEARLY_RIGID
    assert made.counters["evaluations"] < 5_000
