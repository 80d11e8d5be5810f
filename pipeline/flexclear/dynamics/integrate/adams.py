"""Predictor-corrector of Adams, Bashforth and Moulton, order 4, with fixed steps: the integrator of the paper.

The paper says "a predictor-corrector method" with a step of 1e-5 s and neither its order nor its start (Wang & Wang
2019, sec. 6.1, step 8). Assumed: the pair of order 4, predicted, evaluated, corrected once, evaluated (PECE), with
three steps of the classical Runge-Kutta method of order 4 as its start. The method restarts at drive breaks and located
events; a step that is shortened to end on one of these is a Runge-Kutta step.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. III.1.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import hermite, rk4
from flexclear.dynamics.integrate.method import Method, make_attempt, slope, vector
from flexclear.dynamics.integrate.runge_kutta import make_stages
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import INTEGRATORS

LAST = rk4.STAGES
# floats: number of stored slopes (vectors, the latest first), and the time between them
COUNT, DISTANCE, FLOATS = range(3)
MOST_STEPS_BACK = 3


@kernel
def begin(d):
    """Forget all earlier slopes."""
    d.memory[COUNT] = 0.0


@kernel
def alike(d, step):
    """Return True when a step is as long as the distance between the stored slopes."""
    distance = d.memory[DISTANCE]
    # step lengths that differ by less than this fraction are equal: rounding of times
    return abs(step - distance) <= 1e-8 * distance


@kernel
def keep(d, step):
    """Store the slope at the start of an accepted step."""
    if d.memory[COUNT] == 0.0 or not alike(d, step):
        d.memory[COUNT], d.memory[DISTANCE] = 0.0, step
    one, two, three = vector(d, 0), vector(d, 1), vector(d, 2)
    for c in range(d.ny):
        d.w[three + c] = d.w[two + c]
        d.w[two + c] = d.w[one + c]
        d.w[one + c] = d.slopes[c]
    d.memory[COUNT] = min(d.memory[COUNT] + 1.0, MOST_STEPS_BACK)


def make_kernels(evaluate: Callable, lists: object) -> tuple:
    """Build the method's kernels; the method has no error estimate."""
    _, proceed = make_stages(evaluate, rk4.A, rk4.B, rk4.C)
    runge_kutta_step = make_attempt(evaluate, proceed)

    @kernel
    def attempt(d, step):
        """Step from Y to Y_NEW; return False when the right-hand side fails at the predicted state."""
        size, now, predicted = d.ny, slope(d, 0), slope(d, 1)
        if d.memory[COUNT] < MOST_STEPS_BACK or not alike(d, step):
            return runge_kutta_step(d, step)
        one, two, three = vector(d, 0), vector(d, 1), vector(d, 2)
        for c in range(size):
            ahead = 55.0 * d.w[now + c] - 59.0 * d.w[one + c]
            ahead += 37.0 * d.w[two + c] - 9.0 * d.w[three + c]
            d.y_stage[c] = d.y[c] + step / 24.0 * ahead
        evaluate(d, d.time + step, d.at_y_stage, predicted)
        d.evaluations += 1
        for c in range(size):
            ahead = 9.0 * d.w[predicted + c] + 19.0 * d.w[now + c]
            ahead += d.w[two + c] - 5.0 * d.w[one + c]
            d.y_new[c] = d.y[c] + step / 24.0 * ahead
        return d.evaluation == m.OK

    return begin, attempt, None, hermite.make_extend(LAST), keep


METHOD = Method(
    traits=INTEGRATORS["adams-bashforth-moulton"],
    room=m.Room(LAST + 2, hermite.ROWS, FLOATS, MOST_STEPS_BACK),
    last=LAST,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
)
