"""Stages and step of an explicit Runge-Kutta method, from its coefficients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.kernels import kernel


def make_stages(evaluate: Callable, A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[Callable, Callable]:
    """The kernels stage(h, f, w, n, step, i) and attempt(h, f, w, n, step).

    A, B, C: Butcher's tableau; stages beyond len(B) serve error estimates and dense output.
    Row i of SLOPES is the slope of stage i, row 0 that at the start of the step.
    """
    count = len(B)

    @kernel
    def stage(h, f, w, n, step, i):
        """Slope of stage i from those of all earlier ones."""
        size, y, stage_y = h[m.NY], h[m.Y], h[m.Y_STAGE]
        for c in range(size):
            w[stage_y + c] = w[y + c]
        for j in range(i):
            weight = step * A[i, j]
            if weight != 0.0:
                k = slope(h, j)
                for c in range(size):
                    w[stage_y + c] += weight * w[k + c]
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + C[i] * step, stage_y, slope(h, i))
        n[m.EVALUATIONS] += 1

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when a stage has no slope."""
        size = h[m.NY]
        for i in range(1, count):
            stage(h, f, w, n, step, i)
            if n[m.EVALUATION] != m.OK:
                return False
        for c in range(size):
            w[h[m.Y_NEW] + c] = 0.0
        for j in range(count):
            if B[j] != 0.0:
                k = slope(h, j)
                for c in range(size):
                    w[h[m.Y_NEW] + c] += B[j] * w[k + c]
        for c in range(size):
            w[h[m.Y_NEW] + c] = w[h[m.Y] + c] + step * w[h[m.Y_NEW] + c]
        return True

    return stage, attempt
