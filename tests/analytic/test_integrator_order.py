"""Every integrator has the order that it claims, on a tree and on a closed loop; Radau goes where SciPy's goes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexclear.pipeline.core.scene.integrators import INTEGRATORS
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from tests.analytic.integrator_scenes import (
    NO_PROJECTION,
    SCENES,
    double_pendulum,
    engine_with,
    ledger_free,
    reference,
    trajectory,
)

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
        made = trajectory(SCENES[name](), {"integrator": integrator, "step": step, "rtol": rtol})
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
        made = trajectory(SCENES["double pendulum"](), {"integrator": integrator, "rtol": rtol})
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
    made = trajectory(double_pendulum(), {"integrator": "radau", "rtol": 1e-10})
    # both leave some hundred steps of rtol, with different norms
    assert ledger_free(made.rows)[-1] == pytest.approx(known.y[:-2, -1], abs=1e-7)
    # a like number of steps: the estimate and its control are the same method's
    assert 0.3 < made.counters["steps"] / len(known.t) < 3.0
    assert made.counters["jacobians"] <= np.ceil(0.5 * made.counters["steps"])
