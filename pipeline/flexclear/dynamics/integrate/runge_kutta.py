"""Stages, step and dense output of an explicit Runge-Kutta method, from its coefficients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.method import LOST, MADE, await_rates, slope
from flexclear.dynamics.kernels import kernel


def make_stages(
    evaluate: Callable, A: np.ndarray, B: np.ndarray, C: np.ndarray, *, ends: bool = False
) -> tuple[Callable, Callable]:
    """Build the kernels stage(d, step, i) and proceed(d, step).

    A, B, C: Butcher's tableau; stages beyond len(B) serve error estimates and dense output.
    Row i of SLOPES is the slope of stage i, row 0 that at the start of the step.
    ends: whether Y_NEW is evaluated as well, into row len(B).
    """
    count = len(B)

    @kernel
    def combine(d, step, i):
        """Store the argument of stage i, from the slopes of all earlier stages, in Y_STAGE."""
        size, y, stage_y = d.ny, d.at_y, d.at_y_stage
        for c in range(size):
            d.w[stage_y + c] = d.w[y + c]
        for j in range(i):
            weight = step * A[i, j]
            if weight != 0.0:
                k = slope(d, j)
                for c in range(size):
                    d.w[stage_y + c] += weight * d.w[k + c]

    @kernel
    def stage(d, step, i):
        """Compute the slope of stage i from those of all earlier stages."""
        combine(d, step, i)
        evaluate(d, d.time + C[i] * step, d.at_y_stage, slope(d, i))
        d.evaluations += 1

    @kernel
    def proceed(d, step):
        """Continue the step from Y to Y_NEW by the next stage; LOST when the right-hand side fails."""
        size, i = d.ny, d.stage + 1
        if i > 1 and d.evaluation != m.OK:
            return LOST
        if i < count:
            combine(d, step, i)
            return await_rates(d, d.time + C[i] * step, d.at_y_stage, slope(d, i))
        if i > count:
            return MADE
        for c in range(size):
            d.y_new[c] = 0.0
        for j in range(count):
            if B[j] != 0.0:
                k = slope(d, j)
                for c in range(size):
                    d.y_new[c] += B[j] * d.w[k + c]
        for c in range(size):
            d.y_new[c] = d.y[c] + step * d.y_new[c]
        return await_rates(d, d.time + step, d.at_y_new, slope(d, count)) if ends else MADE

    return stage, proceed


def make_dense(last: int, D: np.ndarray) -> tuple[Callable, Callable]:
    """Build the kernels extend(d, step) and interpolate(d, theta, out): dense output in products of theta and 1 -
    theta.

    last: row of the slope at the end.  D: weights of the slopes in each coefficient beyond those of Hermite's cubic.
    Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.6.
    """
    more, slopes = D.shape

    @kernel
    def extend(d, step):
        """Prepare the dense output of the step to Y_NEW, all slopes known."""
        size, dense = d.ny, d.at_dense
        first, final = slope(d, 0), slope(d, last)
        for c in range(size):
            delta = d.y_new[c] - d.y[c]
            d.w[dense + c] = d.y[c]
            d.w[dense + size + c] = delta
            d.w[dense + 2 * size + c] = step * d.w[first + c] - delta
            d.w[dense + 3 * size + c] = 2.0 * delta - step * (d.w[final + c] + d.w[first + c])
            for k in range(more):
                total = 0.0
                for j in range(slopes):
                    total += D[k, j] * d.w[first + j * size + c]
                d.w[dense + (4 + k) * size + c] = step * total

    @kernel
    def interpolate(d, theta, out):
        """Store the state at the fraction `theta` of the step in w from `out` (after `extend`)."""
        size, dense, s = d.ny, d.at_dense, 1.0 - theta
        for c in range(size):
            v = d.w[dense + (3 + more) * size + c]
            for k in range(2 + more, -1, -1):
                v = v * (s if k % 2 == 1 else theta) + d.w[dense + k * size + c]
            d.w[out + c] = v

    return extend, interpolate
