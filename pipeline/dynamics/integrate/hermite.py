"""Cubic dense output from the states and slopes at both ends of a step: error of fourth order in the step.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.6.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.kernels import kernel

#: rows of DENSE: coefficients of the powers of the share of the step
ROWS = 4


def make_extend(last: int) -> Callable:
    """The kernel extend(h, f, w, n, step) of a method whose slope at the end is in row `last`."""

    @kernel
    def extend(h, f, w, n, step):
        size, dense, first, final = h[m.NY], h[m.DENSE], slope(h, 0), slope(h, last)
        for c in range(size):
            y, delta = w[h[m.Y] + c], w[h[m.Y_NEW] + c] - w[h[m.Y] + c]
            start, end = step * w[first + c], step * w[final + c]
            w[dense + c] = y
            w[dense + size + c] = start
            w[dense + 2 * size + c] = 3.0 * delta - 2.0 * start - end
            w[dense + 3 * size + c] = start + end - 2.0 * delta

    return extend


@kernel
def interpolate(h, w, theta, out):
    """State at the share `theta` of the step, stored in w from `out` (after `extend`); any cubic in DENSE."""
    size, dense = h[m.NY], h[m.DENSE]
    for c in range(size):
        v = w[dense + 3 * size + c] * theta + w[dense + 2 * size + c]
        w[out + c] = (v * theta + w[dense + size + c]) * theta + w[dense + c]
