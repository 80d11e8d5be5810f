"""A mode a thousand times faster than the motion: implicit methods step over it, explicit ones cannot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexclear.pipeline.core.system.errors import SolverError
from tests.analytic.integrator_scenes import double_pendulum, trajectory

pytestmark = pytest.mark.slow
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


@pytest.mark.parametrize("solver", [{"integrator": "generalized-alpha", "step": STEP}, {"integrator": "radau"}])
def test_implicit_methods_step_over_a_stiff_mode(solver: dict[str, Any]) -> None:
    made = trajectory(stiff_pendulum(), {"rtol": 1e-6, **solver})
    known = trajectory(rigid_pendulum(), {"rtol": 1e-12})
    angle = np.unwrap(made.rows[:, 1:3], axis=0)
    # the hinge that is held hardly gives way; the other swings as the rigid pendulum does
    first = np.argmax(np.ptp(angle, axis=0))
    assert np.abs(angle[:, 1 - first]).max() < NEARLY_RIGID
    assert np.abs(angle[:, first] - known.rows[:, 1]).max() < NEARLY_RIGID
    assert made.counters["evaluations"] < 5_000


def test_an_explicit_method_cannot_at_this_step() -> None:
    with pytest.raises(SolverError, match="too long"):
        trajectory(stiff_pendulum(), {"rtol": 1e-6, "integrator": "rk4", "step": STEP})
