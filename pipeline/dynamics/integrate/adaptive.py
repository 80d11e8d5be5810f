"""Steps whose length the estimated error chooses.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.4;
step control with memory: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.norms import finite, scaled_norm, set_error_scales
from flexclear.pipeline.dynamics.integrate.stepper import FAILED
from flexclear.pipeline.dynamics.kernels import kernel

# the factor to the next step is SAFETY norm^(-exponent) last_norm^MEMORY;
# the memory keeps steps quiet where stability, not accuracy, limits them
SAFETY, SHRINK, GROW, MEMORY = 0.9, 0.2, 6.0, 0.04
LEAST_NORM = 1e-4
#: how much stricter steps are judged while a contact is closed: the errors of a few steps there become that of a
#: rebound speed, which every later impact magnifies. A bounce without loss keeps its energy to 1e-10 at the default
#: tolerance, seven times better than with 1, for a fifth more evaluations
STRICTER = 10.0


def make_step_control(
    evaluate: Callable, contacts: tuple[Callable, Callable], begin: Callable, error: Callable, method: Any
) -> tuple:
    """The kernels first_step, error_norm, after_rejection and next_step of the stepper."""
    order = method.error_order + 1
    exponent = -1.0 / order
    remembering = exponent + 0.2 * MEMORY
    steady = method.steady
    watch_start, any_closed = contacts

    @kernel
    def first_step(h, f, w, n):
        """Slope at the start of a segment, and a first step; False when the equations have no solution here."""
        c, y, slope = h[m.CONTROL], h[m.Y], h[m.SLOPES]
        other = slope + h[m.NY]
        evaluate(h, f, w, n, w[c + m.TIME], y, slope)
        n[m.EVALUATIONS] += 2
        if n[m.EVALUATION] != m.OK or not finite(h, w, slope):
            n[m.STATUS] = m.NOT_A_NUMBER if n[m.EVALUATION] == m.OK else m.NO_START
            return False
        watch_start(h, w)
        set_error_scales(h, f, w, y)
        size, steepness = scaled_norm(h, w, y), scaled_norm(h, w, slope)
        step = 1e-6 * w[c + m.SPAN]
        if size > 1.0 and steepness > 0.0:  # a state below its tolerance, rounding of zero, sets no scale
            step = min(0.01 * size / steepness, 0.01 * w[c + m.SPAN])
        step = min(step, w[c + m.END] - w[c + m.TIME])
        for k in range(h[m.NY]):
            w[h[m.Y_STAGE] + k] = w[y + k] + step * w[slope + k]
        evaluate(h, f, w, n, w[c + m.TIME] + step, h[m.Y_STAGE], other)
        if n[m.EVALUATION] == m.OK:
            for k in range(h[m.NY]):
                w[other + k] -= w[slope + k]
            steepness = max(steepness, scaled_norm(h, w, other) / step)
            if steepness > 0.0:
                step = min(100.0 * step, (0.01 / steepness) ** (1.0 / order))
        if any_closed(h, n) and w[c + m.TOUCHED_STEP] > 0.0:
            step = min(step, w[c + m.TOUCHED_STEP])
        w[c + m.STEP] = step
        w[c + m.FIRST], w[c + m.REJECTED_STEP] = 1.0, 0.0
        w[c + m.LAST_NORM], w[c + m.MOST_GROWTH] = LEAST_NORM, GROW
        n[m.FRESH] = 0
        begin(h, f, w, n)
        return True

    @kernel
    def error_norm(h, f, w, n, step):
        """Error norm of the step to Y_NEW, 1 at the tolerance."""
        set_error_scales(h, f, w, h[m.Y_NEW])
        if any_closed(h, n):
            for g in range(h[m.N_GROUPS]):
                w[h[m.MAGNITUDE] + g] /= STRICTER
        return error(h, f, w, n, step)

    @kernel
    def seen_order(h, w, step, norm):
        """Power of the step with which the error falls, as this rejected step and the one before it say.

        Where a contact begins or friction turns, the solution has less derivatives than the method asks for.
        """
        c = h[m.CONTROL]
        longer, worse = w[c + m.REJECTED_STEP], w[c + m.REJECTED_NORM]
        if longer == 0.0 or worse >= FAILED:
            return 1.0 * order
        if norm >= worse:
            return 1.0
        return min(max(np.log(worse / norm) / np.log(longer / step), 1.0), 1.0 * order)

    @kernel
    def after_rejection(h, w, n, step, norm):
        """Try again with a shorter step."""
        c = h[m.CONTROL]
        w[c + m.STEP] = step * max(SHRINK, SAFETY * norm ** (-1.0 / seen_order(h, w, step, norm)))
        w[c + m.REJECTED_STEP], w[c + m.REJECTED_NORM] = step, norm
        w[c + m.MOST_GROWTH] = 1.0
        return True

    @kernel
    def next_step(h, w, n, step, norm):
        """Length of the step after the one that has just been accepted."""
        c = h[m.CONTROL]
        norm = max(norm, LEAST_NORM)
        growth = SAFETY * norm**remembering * w[c + m.LAST_NORM] ** MEMORY
        growth = min(w[c + m.MOST_GROWTH], max(SHRINK, growth))
        if w[c + m.FIRST] > 0.0 and any_closed(h, n):
            w[c + m.TOUCHED_STEP] = step * growth
        w[c + m.FIRST], w[c + m.REJECTED_STEP] = 0.0, 0.0
        w[c + m.LAST_NORM], w[c + m.MOST_GROWTH] = norm, GROW
        return step if 1.0 <= growth < steady else step * growth

    return first_step, error_norm, after_rejection, next_step
