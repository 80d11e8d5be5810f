"""Predictor-corrector of Adams, Bashforth and Moulton, order 4, with fixed steps: what the paper integrates with.

The paper says "a predictor-corrector method" with a step of 1e-5 s and neither its order nor its start (Wang & Wang
2019, sec. 6.1, step 8). Assumed: the pair of order 4, predicted, evaluated, corrected once, evaluated (PECE), with
three steps of the classical Runge-Kutta method of order 4 as its start. It starts again where integration does (drive
breaks, located events); a step that is shortened to end on one of these is a Runge-Kutta step.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. III.1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.core.integrators import INTEGRATORS
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import hermite, rk4
from flexclear.pipeline.dynamics.integrate.method import Method, slope
from flexclear.pipeline.dynamics.integrate.runge_kutta import make_stages
from flexclear.pipeline.dynamics.kernels import kernel

LAST = rk4.STAGES
# memory: number of slopes kept, their distance, then the slopes themselves, the latest first
COUNT, DISTANCE, KEPT = range(3)
MOST = 3
#: steps whose lengths differ by less than this share are alike: rounding of times
ALIKE = 1e-8


def memory(h: np.ndarray) -> int:
    """Floats kept between steps."""
    return KEPT + MOST * int(h[m.NY])


@kernel
def begin(h, f, w, n):
    """Forget all earlier slopes."""
    w[h[m.MEMORY] + COUNT] = 0.0


@kernel
def alike(h, w, step):
    """Whether a step is as long as those between the slopes that are kept."""
    distance = w[h[m.MEMORY] + DISTANCE]
    return abs(step - distance) <= ALIKE * distance


@kernel
def keep(h, f, w, n, step):
    """Remember the slope where an accepted step started."""
    o, size = h[m.MEMORY], h[m.NY]
    if w[o + COUNT] == 0.0 or not alike(h, w, step):
        w[o + COUNT], w[o + DISTANCE] = 0.0, step
    for c in range(size):
        w[o + KEPT + 2 * size + c] = w[o + KEPT + size + c]
        w[o + KEPT + size + c] = w[o + KEPT + c]
        w[o + KEPT + c] = w[slope(h, 0) + c]
    w[o + COUNT] = min(w[o + COUNT] + 1.0, MOST)


def make_kernels(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels; it has no error estimate."""
    _, runge_kutta_step = make_stages(evaluate, rk4.A, rk4.B, rk4.C)

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when there is no slope at the predicted state."""
        o, size, now, predicted = h[m.MEMORY], h[m.NY], slope(h, 0), slope(h, 1)
        if w[o + COUNT] < MOST or not alike(h, w, step):
            return runge_kutta_step(h, f, w, n, step)
        one, two, three = o + KEPT, o + KEPT + size, o + KEPT + 2 * size
        for c in range(size):
            ahead = 55.0 * w[now + c] - 59.0 * w[one + c]
            ahead += 37.0 * w[two + c] - 9.0 * w[three + c]
            w[h[m.Y_STAGE] + c] = w[h[m.Y] + c] + step / 24.0 * ahead
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + step, h[m.Y_STAGE], predicted)
        n[m.EVALUATIONS] += 1
        for c in range(size):
            ahead = 9.0 * w[predicted + c] + 19.0 * w[now + c]
            ahead += w[two + c] - 5.0 * w[one + c]
            w[h[m.Y_NEW] + c] = w[h[m.Y] + c] + step / 24.0 * ahead
        return n[m.EVALUATION] == m.OK

    return begin, attempt, None, hermite.make_extend(LAST), keep


METHOD = Method(
    traits=INTEGRATORS["adams-bashforth-moulton"],
    slopes=LAST + 2,
    last=LAST,
    dense=hermite.ROWS,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    memory=memory,
)
