"""Stages and step of an explicit Runge-Kutta method, from its coefficients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.kernels import kernel


def make_stages(evaluate: Callable, A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[Callable, Callable]:
    """The kernels stage(d, step, i) and attempt(d, step).

    A, B, C: Butcher's tableau; stages beyond len(B) serve error estimates and dense output.
    Row i of SLOPES is the slope of stage i, row 0 that at the start of the step.
    """
    count = len(B)

    @kernel
    def stage(d, step, i):
        """Slope of stage i from those of all earlier ones."""
        size, y, stage_y = d.ny, d.at_y, d.at_y_stage
        for c in range(size):
            d.w[stage_y + c] = d.w[y + c]
        for j in range(i):
            weight = step * A[i, j]
            if weight != 0.0:
                k = slope(d, j)
                for c in range(size):
                    d.w[stage_y + c] += weight * d.w[k + c]
        evaluate(d, d.time + C[i] * step, stage_y, slope(d, i))
        d.evaluations += 1

    @kernel
    def attempt(d, step):
        """State Y_NEW after a step from Y; False when a stage has no slope."""
        size = d.ny
        for i in range(1, count):
            stage(d, step, i)
            if d.evaluation != m.OK:
                return False
        for c in range(size):
            d.y_new[c] = 0.0
        for j in range(count):
            if B[j] != 0.0:
                k = slope(d, j)
                for c in range(size):
                    d.y_new[c] += B[j] * d.w[k + c]
        for c in range(size):
            d.y_new[c] = d.y[c] + step * d.y_new[c]
        return True

    return stage, attempt
