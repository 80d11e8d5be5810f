"""Roots of functions of one variable.

SciPy's `brentq`, to the last bit: its module takes longer to import than most runs take.
"""

from __future__ import annotations

from collections.abc import Callable

#: a bracket is at most halved some thousand times before its ends are neighbours
ITERATIONS = 1100


def brent(f: Callable[[float], float], a: float, b: float, xtol: float, rtol: float) -> float:
    """A root of f between a and b, where it has values of opposite sign, to xtol + rtol |root|.

    Raises ValueError where the signs are the same.
    Source: Brent (1973), Algorithms for Minimization Without Derivatives, ch. 4.
    """
    before, now, counter = a, b, 0.0
    f_before, f_now, f_counter = f(before), f(now), 0.0
    if f_before == 0.0:
        return before
    if f_now == 0.0:
        return now
    if (f_before < 0.0) == (f_now < 0.0):
        raise ValueError("f(a) and f(b) must have different signs")
    last = step = 0.0
    for _ in range(ITERATIONS):
        if f_before != 0.0 and f_now != 0.0 and (f_before < 0.0) != (f_now < 0.0):
            counter, f_counter = before, f_before
            last = step = now - before
        if abs(f_counter) < abs(f_now):  # the best of the three is the present one
            before, now, counter = now, counter, now
            f_before, f_now, f_counter = f_now, f_counter, f_now
        near, half = 0.5 * (xtol + rtol * abs(now)), 0.5 * (counter - now)
        if f_now == 0.0 or abs(half) < near:
            return now
        if abs(last) > near and abs(f_now) < abs(f_before):
            tried = _interpolated((before, now, counter), (f_before, f_now, f_counter))
            short = 2.0 * abs(tried) < min(abs(last), 3.0 * abs(half) - near)
            last, step = (step, tried) if short else (half, half)
        else:
            last = step = half
        before, f_before = now, f_now
        now += step if abs(step) > near else near if half > 0.0 else -near
        f_now = f(now)
    return now


def _interpolated(x: tuple[float, float, float], f: tuple[float, float, float]) -> float:
    """Step from the present of three points to the root of the inverse parabola, or of the secant of two points."""
    (before, now, counter), (f_before, f_now, f_counter) = x, f
    if before == counter:
        return -f_now * (now - before) / (f_now - f_before)
    slope, other = (f_before - f_now) / (before - now), (f_counter - f_now) / (counter - now)
    return -f_now * (f_counter * other - f_before * slope) / (other * slope * (f_counter - f_before))
