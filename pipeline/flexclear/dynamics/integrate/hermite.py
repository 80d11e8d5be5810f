"""Cubic dense output from the states and slopes at both ends of a step: error of fourth order in the step.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.6.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics.integrate.method import slope
from flexclear.dynamics.kernels import kernel

#: rows of DENSE: coefficients of the powers of the fraction of the step
ROWS = 4


def make_extend(last: int) -> Callable:
    """Build the kernel extend(d, step) of a method whose slope at the end is in row `last`."""

    @kernel
    def extend(d, step):
        size, dense, first, final = d.ny, d.at_dense, slope(d, 0), slope(d, last)
        for c in range(size):
            y, delta = d.y[c], d.y_new[c] - d.y[c]
            start, end = step * d.w[first + c], step * d.w[final + c]
            d.w[dense + c] = y
            d.w[dense + size + c] = start
            d.w[dense + 2 * size + c] = 3.0 * delta - 2.0 * start - end
            d.w[dense + 3 * size + c] = start + end - 2.0 * delta

    return extend


@kernel
def interpolate(d, theta, out):
    """Store the state at the fraction `theta` of the step in w from `out`, from the cubic in DENSE (after `extend`)."""
    size, dense = d.ny, d.at_dense
    for c in range(size):
        v = d.w[dense + 3 * size + c] * theta + d.w[dense + 2 * size + c]
        d.w[out + c] = (v * theta + d.w[dense + size + c]) * theta + d.w[dense + c]
