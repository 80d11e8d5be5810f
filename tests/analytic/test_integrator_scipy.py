"""The compiled Radau method against SciPy's, on the same compiled right-hand side."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from tests.analytic.integrator_scenes import double_pendulum, engine_with, ledger_free, trajectory


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
