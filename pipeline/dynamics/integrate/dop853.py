"""Explicit Runge-Kutta method of order 8 by Dormand and Prince, dense output of order 7.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993),
sec. II.5 (method and error estimate) and II.6 (dense output).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.dynamics.integrate.dop853_coefficients import E3, E5, ERROR_ORDER, EXTENDED, STAGES, A, B, C, D
from pipeline.dynamics.integrate.state import TIME
from pipeline.dynamics.tables import CONTROL, DENSE, EVALUATION, GROUPS, MAGNITUDE, NY, OK, SLOPES, Y_NEW, Y_STAGE, Y
from pipeline.dynamics.vectors import index, kernel


@kernel
def slope(h, i):
    """Where w holds the slope of stage i."""
    return h[SLOPES] + h[NY] * i


@kernel
def error(h, w, step):
    """Norm of the local error, 1 at the tolerance; MAGNITUDE holds each group's scale."""
    size, k = h[NY], h[SLOPES]
    five = three = 0.0
    for c in range(size):
        a = b = 0.0
        for j in range(STAGES):
            a += E5[j] * w[index(k + j * size + c)]
            b += E3[j] * w[index(k + j * size + c)]
        s = 1.0 / w[index(h[MAGNITUDE] + h[index(h[GROUPS] + c)])]
        five += (a * s) ** 2
        three += (b * s) ** 2
    if five == 0.0 and three == 0.0:
        return 0.0
    return abs(step) * five / np.sqrt((five + 0.01 * three) * size)


@kernel
def interpolate(h, w, theta, out):
    """State at the share `theta` of the step, stored in w from `out` (after `extend`)."""
    size, F = h[NY], h[DENSE]
    s = 1.0 - theta
    for c in range(size):
        v = w[index(F + 6 * size + c)] * theta
        v = (v + w[index(F + 5 * size + c)]) * s
        v = (v + w[index(F + 4 * size + c)]) * theta
        v = (v + w[index(F + 3 * size + c)]) * s
        v = (v + w[index(F + 2 * size + c)]) * theta
        v = (v + w[index(F + size + c)]) * s
        w[index(out + c)] = w[index(F + 7 * size + c)] + (v + w[index(F + c)]) * theta


def compose(evaluate: Callable) -> tuple[Callable, Callable]:
    """The kernels attempt and extend."""

    @kernel
    def stage(h, f, w, n, step, i):
        """Slope of stage i from those of all earlier ones."""
        size, y, stage_y = h[NY], h[Y], h[Y_STAGE]
        for c in range(size):
            w[index(stage_y + c)] = w[index(y + c)]
        for j in range(i):
            weight = step * A[i, j]
            if weight != 0.0:
                k = slope(h, j)
                for c in range(size):
                    w[index(stage_y + c)] += weight * w[index(k + c)]
        evaluate(h, f, w, n, w[index(h[CONTROL] + TIME)] + C[i] * step, stage_y, slope(h, i))

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y, given its slope in row 0; False when a stage has none."""
        size = h[NY]
        for i in range(1, STAGES):
            stage(h, f, w, n, step, i)
            if n[EVALUATION] != OK:
                return False
        for c in range(size):
            w[index(h[Y_NEW] + c)] = 0.0
        for j in range(STAGES):
            if B[j] != 0.0:
                k = slope(h, j)
                for c in range(size):
                    w[index(h[Y_NEW] + c)] += B[j] * w[index(k + c)]
        for c in range(size):
            w[index(h[Y_NEW] + c)] = w[index(h[Y] + c)] + step * w[index(h[Y_NEW] + c)]
        return True

    @kernel
    def extend(h, f, w, n, step):
        """Prepare the dense output of the step to Y_NEW, whose slope is in row STAGES."""
        size, F = h[NY], h[DENSE]
        for i in range(STAGES + 1, EXTENDED):
            stage(h, f, w, n, step, i)
        first, last = slope(h, 0), slope(h, STAGES)
        for c in range(size):
            delta = w[index(h[Y_NEW] + c)] - w[index(h[Y] + c)]
            w[index(F + c)] = delta
            w[index(F + size + c)] = step * w[index(first + c)] - delta
            w[index(F + 2 * size + c)] = 2.0 * delta - step * (w[index(last + c)] + w[index(first + c)])
            for d in range(4):
                total = 0.0
                for j in range(EXTENDED):
                    total += D[d, j] * w[index(first + j * size + c)]
                w[index(F + (3 + d) * size + c)] = step * total
            w[index(F + 7 * size + c)] = w[index(h[Y] + c)]

    return attempt, extend


@dataclass(frozen=True)
class Method:
    """What the stepper needs of a Runge-Kutta method.

    slopes: rows of SLOPES.  last: row of the slope at the step's end.  dense: rows of DENSE.
    extra: evaluations that the dense output costs.  gap: middle of the widest gap between the stages, as share of
    the step.
    """

    slopes: int
    last: int
    dense: int
    extra: int
    error_order: int
    compose: Callable
    error: Callable
    interpolate: Callable
    gap: float = 0.5


METHOD = Method(EXTENDED + 1, STAGES, 8, EXTENDED - STAGES - 1, ERROR_ORDER, compose, error, interpolate, 0.467)
