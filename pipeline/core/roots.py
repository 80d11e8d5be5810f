"""A root of a function of one variable, as ``scipy.optimize.brentq`` finds it, to the last bit.

Importing that package takes three times as long as a short run. Source: Brent (1973), Algorithms for Minimization
without Derivatives, ch. 4, in the form of SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable

#: steps at most; bisection alone needs fewer for any interval of floats
STEPS = 2200


def root_between(f: Callable[[float], float], low: float, high: float, xtol: float, rtol: float) -> float:
    """Argument between `low` and `high` where f is zero, to xtol + rtol of itself.

    Raises ValueError where f has the same sign at both ends.
    """
    last, x = low, high
    f_last, f_x = f(last), f(x)
    if f_last == 0.0:
        return last
    if f_x == 0.0:
        return x
    if (f_last < 0.0) == (f_x < 0.0):
        raise ValueError(f"f has the same sign at {low:.6g} and at {high:.6g}")
    other = f_other = before = step = 0.0  # the end with the other sign, and the last two steps
    for _ in range(STEPS):
        if f_last != 0.0 and f_x != 0.0 and (f_last < 0.0) != (f_x < 0.0):
            other, f_other = last, f_last
            before = step = x - last
        if abs(f_other) < abs(f_x):
            last, x, other = x, other, x
            f_last, f_x, f_other = f_x, f_other, f_x
        least, half = (xtol + rtol * abs(x)) / 2.0, (other - x) / 2.0
        if f_x == 0.0 or abs(half) < least:
            break
        before, step = _next(f_last, f_x, f_other, (last, x, other), (before, step), (least, half))
        last, f_last = x, f_x
        x += step if abs(step) > least else math.copysign(least, half)
        f_x = f(x)
    return x


def _next(
    f_last: float,
    f_x: float,
    f_other: float,
    at: tuple[float, float, float],
    steps: tuple[float, float],
    limits: tuple[float, float],
) -> tuple[float, float]:
    """The last two steps after one that interpolates, where that is short enough, else halves the interval."""
    (last, x, other), (before, step), (least, half) = at, steps, limits
    if abs(before) > least and abs(f_x) < abs(f_last):
        if last == other:
            tried = -f_x * (x - last) / (f_x - f_last)
        else:
            slope, wide = (f_last - f_x) / (last - x), (f_other - f_x) / (other - x)
            tried = -f_x * (f_other * wide - f_last * slope) / (wide * slope * (f_other - f_last))
        if 2.0 * abs(tried) < min(abs(before), 3.0 * abs(half) - least):
            return step, tried
    return half, half
