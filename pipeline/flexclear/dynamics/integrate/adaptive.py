"""Step size control by the estimated local error.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.4;
step control with memory: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.norms import scaled_norm, set_error_scales
from flexclear.dynamics.integrate.stepper import FAILED
from flexclear.dynamics.kernels import kernel

# the next step is longer by the factor SAFETY norm^(-exponent) last_norm^MEMORY;
# the memory damps oscillating step lengths where stability, not accuracy, limits the steps
SAFETY, SHRINK, GROW, MEMORY = 0.9, 0.2, 6.0, 0.04
LEAST_NORM = 1e-4


def make_step_control(evaluate: Callable, any_closed: Callable, error: Callable, method: Any) -> tuple:
    """Build the stepper's kernels first_step, error_norm, after_rejection and next_step."""
    order = method.error_order + 1
    exponent = -1.0 / order
    remembering = exponent + 0.2 * MEMORY
    steady = method.steady

    @kernel
    def first_step(d):
        """Return the length of a segment's first step, from the slopes at its start and a little later."""
        y, slope = d.at_y, d.at_slopes
        other = slope + d.ny
        set_error_scales(d, y)
        size, steepness = scaled_norm(d, y), scaled_norm(d, slope)
        step = 1e-6 * d.span
        if size > 1.0 and steepness > 0.0:  # a state below its tolerance, rounding of zero, sets no scale
            step = min(0.01 * size / steepness, 0.01 * d.span)
        step = min(step, d.end - d.time)
        for k in range(d.ny):
            d.y_stage[k] = d.w[y + k] + step * d.w[slope + k]
        evaluate(d, d.time + step, d.at_y_stage, other)
        d.evaluations += 1
        if d.evaluation == m.OK:
            for k in range(d.ny):
                d.w[other + k] -= d.w[slope + k]
            steepness = max(steepness, scaled_norm(d, other) / step)
            if steepness > 0.0:
                step = min(100.0 * step, (0.01 / steepness) ** (1.0 / order))
        if any_closed(d) and d.touched_step > 0.0:
            step = min(step, d.touched_step)
        d.first, d.rejected_step = 1.0, 0.0
        d.last_norm, d.most_growth = LEAST_NORM, GROW
        return step

    @kernel
    def error_norm(d, step):
        """Return the error norm of the step to Y_NEW, 1 at the tolerance."""
        set_error_scales(d, d.at_y_new)
        if any_closed(d):
            for g in range(d.n_groups):
                # the tolerance is divided by this while a contact is closed: the errors of a few steps there become the
                # error of the rebound speed, which every later impact magnifies. A bounce without loss conserves energy
                # to 1e-10 at the default tolerance, seven times better than with 1, for a fifth more evaluations
                d.magnitude[g] /= 10.0
        return error(d, step)

    @kernel
    def seen_order(d, step, norm):
        """Return the order with which the error falls, from this rejected step and the one before it.

        Where a contact begins or friction reverses, the solution has fewer derivatives than the method's order needs.
        """
        longer, worse = d.rejected_step, d.rejected_norm
        if longer == 0.0 or worse >= FAILED:
            return 1.0 * order
        if norm >= worse:
            return 1.0
        return min(max(np.log(worse / norm) / np.log(longer / step), 1.0), 1.0 * order)

    @kernel
    def after_rejection(d, step, norm):
        """Shorten the step for the next attempt."""
        d.step = step * max(SHRINK, SAFETY * norm ** (-1.0 / seen_order(d, step, norm)))
        d.rejected_step, d.rejected_norm = step, norm
        d.most_growth = 1.0
        return True

    @kernel
    def next_step(d, step, norm):
        """Return the length of the step after an accepted one."""
        norm = max(norm, LEAST_NORM)
        growth = SAFETY * norm**remembering * d.last_norm**MEMORY
        growth = min(d.most_growth, max(SHRINK, growth))
        if d.first > 0.0 and any_closed(d):
            d.touched_step = step * growth
        d.first, d.rejected_step = 0.0, 0.0
        d.last_norm, d.most_growth = norm, GROW
        return step if 1.0 <= growth < steady else step * growth

    return first_step, error_norm, after_rejection, next_step
