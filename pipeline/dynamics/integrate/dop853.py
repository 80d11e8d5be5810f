"""Explicit Runge-Kutta method of order 8 by Dormand and Prince, dense output of order 7.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993),
sec. II.5 (method and error estimate) and II.6 (dense output).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate import stages
from pipeline.dynamics.integrate.dop853_coefficients import E3, E5, ERROR_ORDER, EXTENDED, STAGES, A, B, C, D
from pipeline.dynamics.integrate.method import Method, begin_afresh, keep_nothing
from pipeline.dynamics.integrate.stages import slope
from pipeline.dynamics.kernels import kernel


@kernel
def error(h, f, w, n, step):
    """Norm of the local error, 1 at the tolerance; MAGNITUDE holds each group's scale."""
    size, k = h[m.NY], h[m.SLOPES]
    five = three = 0.0
    for c in range(size):
        a = b = 0.0
        for j in range(STAGES):
            a += E5[j] * w[k + j * size + c]
            b += E3[j] * w[k + j * size + c]
        s = 1.0 / w[h[m.MAGNITUDE] + m.GROUPS.group(h, c)]
        five += (a * s) ** 2
        three += (b * s) ** 2
    if five == 0.0 and three == 0.0:
        return 0.0
    return abs(step) * five / np.sqrt((five + 0.01 * three) * size)


@kernel
def interpolate(h, w, theta, out):
    """State at the share `theta` of the step, stored in w from `out` (after `extend`)."""
    size, F = h[m.NY], h[m.DENSE]
    s = 1.0 - theta
    for c in range(size):
        v = w[F + 6 * size + c] * theta
        v = (v + w[F + 5 * size + c]) * s
        v = (v + w[F + 4 * size + c]) * theta
        v = (v + w[F + 3 * size + c]) * s
        v = (v + w[F + 2 * size + c]) * theta
        v = (v + w[F + size + c]) * s
        w[out + c] = w[F + 7 * size + c] + (v + w[F + c]) * theta


def compose(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels."""
    stage, attempt = stages.compose(evaluate, A, B, C)

    @kernel
    def extend(h, f, w, n, step):
        """Prepare the dense output of the step to Y_NEW, whose slope is in row STAGES."""
        size, F = h[m.NY], h[m.DENSE]
        for i in range(STAGES + 1, EXTENDED):
            stage(h, f, w, n, step, i)
        first, last = slope(h, 0), slope(h, STAGES)
        for c in range(size):
            delta = w[h[m.Y_NEW] + c] - w[h[m.Y] + c]
            w[F + c] = delta
            w[F + size + c] = step * w[first + c] - delta
            w[F + 2 * size + c] = 2.0 * delta - step * (w[last + c] + w[first + c])
            for d in range(4):
                total = 0.0
                for j in range(EXTENDED):
                    total += D[d, j] * w[first + j * size + c]
                w[F + (3 + d) * size + c] = step * total
            w[F + 7 * size + c] = w[h[m.Y] + c]

    return begin_afresh, attempt, error, extend, keep_nothing


# 6.1: Hairer & Wanner, Solving Ordinary Differential Equations II, sec. IV.2, and their code
METHOD = Method(EXTENDED + 1, STAGES, 8, ERROR_ORDER, compose, interpolate, stability=6.1)
