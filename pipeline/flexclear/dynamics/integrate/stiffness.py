"""Detection of steps of an explicit method that stability limits, not accuracy.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.2.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics.integrate.method import slope
from flexclear.dynamics.integrate.norms import error_scale
from flexclear.dynamics.kernels import kernel

#: changes of state below this fraction of the tolerance are rounding, from which no rate can be computed
LEAST_CHANGE = 1e-2


@kernel
def difference(d, first, count, a, b):
    """Return the norm of the difference of states or slopes at a and b in w, from variable `first` on, by tolerance."""
    total = 0.0
    for k in range(first, first + count):
        change = (d.w[a + k] - d.w[b + k]) / error_scale(d, k)
        total += change * change
    return np.sqrt(total)


@kernel
def steepness(d, last):
    """Return the largest rate [1/s] of the equations, from the last stage and the end of the step.

    Both are at the same time; the change of slope over the change of state estimates the spectral radius. From the
    speeds alone it diverges where an oscillation's speeds happen to agree. So the result is at most the geometric mean
    with the estimate from the positions, which for an oscillation is its frequency.
    """
    end, stage = slope(d, last), slope(d, last - 1)
    speeds = difference(d, d.nq, d.nv, d.at_y_new, d.at_y_stage)
    if not speeds > LEAST_CHANGE * np.sqrt(d.nv):
        return 0.0
    rate = difference(d, d.nq, d.nv, end, stage) / speeds
    positions = difference(d, 0, d.nq, d.at_y_new, d.at_y_stage)
    if not positions > LEAST_CHANGE * np.sqrt(d.nq):
        return rate
    return min(rate, np.sqrt(rate * difference(d, 0, d.nq, end, stage) / positions))


@kernel
def detect_nothing(d, step):
    """Do nothing: `detect_stiffness` of an implicit method, or of one without suitable stages."""


def make_detect_stiffness(method: Any) -> Callable:
    """Build the kernel detect_stiffness(d, step), for accepted steps."""
    if method.stability is None:
        return detect_nothing
    last, reach = method.last, method.stability

    @kernel
    def detect_stiffness(d, step):
        """Store the step's largest rate, and count the step if stability limits it."""
        rate = steepness(d, last)
        d.steepest = max(d.steepest, rate)
        # adaptive steps oscillate about the stability limit: from this fraction of it on they count as limited
        share = 1.0 if d.fixed > 0.0 else 0.7
        if rate * step > share * reach:
            d.stiff_steps += 1

    return detect_stiffness
