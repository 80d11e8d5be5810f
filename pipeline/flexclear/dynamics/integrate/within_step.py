"""Evaluation inside a step, its repetition, roots and maxima: the tools that locate events and kinks of friction.

Source: Brent (1973), *Algorithms for Minimization without Derivatives*, ch. 5 (maxima); Dowell & Jarratt (1971), *BIT*
11, 168-174 (the Illinois rule).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.integrate.method import slope
from flexclear.dynamics.kernels import kernel

#: last correction of a root as a fraction of the step (the remaining error is about its square), and of a maximum,
#: which is flat
ROOT_CORRECTION, MAXIMUM_CORRECTION = 1e-8, 1e-6
GOLDEN = 0.3819660112501051
MOST_LOOKS = 60


def make_evaluate_at(evaluate: Callable, method: Any) -> Callable:
    """Build the kernel evaluate_at(d, step, theta), which evaluates the dense output at a fraction of the step."""
    interpolate, spare = method.interpolate, method.room.slopes - 1  # a row of SLOPES that no stage uses

    @kernel
    def evaluate_at(d, step, theta):
        interpolate(d, theta, d.at_y_stage)
        evaluate(d, d.time + theta * step, d.at_y_stage, slope(d, spare))
        d.evaluations += 1

    return evaluate_at


def make_repeat(evaluate: Callable, attempt: Callable, project: Callable, method: Any) -> Callable:
    """Build the kernel repeat(d, step), which repeats the step with another length; it returns False on failure."""
    last = method.last

    @kernel
    def repeat(d, step):
        """Repeat the step with another length, and close the loops at its end."""
        d.evaluations += 1
        if not attempt(d, step):
            return False
        t, final = d.time + step, slope(d, last)
        evaluate(d, t, d.at_y_new, final)
        used = project(d.h, d.f, d.w, d.n, t, d.at_y_new, final, 1e-3 * d.rtol * d.length)
        d.evaluations += max(used, 0)
        return used >= 0

    return repeat


def make_locate(value_at: Callable) -> Callable:
    """Build the kernel locate(d, step, which, level, enough, a, b, fa, fb) -> fraction of the step.

    value_at(d, step, theta, which): evaluates the dense output at a fraction of the step, and gives a value there.
    """

    @kernel
    def locate(d, step, which, level, enough, a, b, fa, fb):
        """Return the fraction of the step in (a, b) where a value reaches a level (Illinois rule).

        fa, fb: its differences from the level at a and b. A difference of at most `enough` counts as reached.
        """
        side, theta = 0, b
        for _ in range(MOST_LOOKS):
            before = theta
            theta = (a * fb - b * fa) / (fb - fa)
            if not a < theta < b:
                theta = 0.5 * (a + b)
            value = value_at(d, step, theta, which) - level
            if abs(value) <= enough or abs(theta - before) <= ROOT_CORRECTION:
                return theta
            if (value > 0.0) == (fb > 0.0):
                b, fb = theta, value
                fa, side = (0.5 * fa, 1) if side == 1 else (fa, 1)
            else:
                a, fa = theta, value
                fb, side = (0.5 * fb, -1) if side == -1 else (fb, -1)
        return theta

    return locate


def make_maximum(evaluate_at: Callable) -> Callable:
    """Build the kernel maximum(d, step, place, sign) -> largest sign * w[place] within the step, and where."""

    @kernel
    def maximum(d, step, place, sign):
        """Return the largest sign * w[place] within the step, and where, by parabolas or golden sections."""
        a, b, move, e = 0.0, 1.0, 0.0, 0.0
        x = second = third = GOLDEN
        evaluate_at(d, step, x)
        fx = f_second = f_third = sign * d.w[place]
        for _ in range(MOST_LOOKS):
            middle = 0.5 * (a + b)
            if abs(x - middle) <= 2.0 * MAXIMUM_CORRECTION - 0.5 * (b - a):
                break
            r, q = (x - second) * (f_third - fx), (x - third) * (f_second - fx)
            p, q = (x - third) * q - (x - second) * r, 2.0 * (q - r)
            p, q = (-p, q) if q > 0.0 else (p, -q)
            wild = abs(p) >= abs(0.5 * q * e) or p <= q * (a - x) or p >= q * (b - x)
            if abs(e) <= MAXIMUM_CORRECTION or wild:
                e = b - x if x < middle else a - x
                move = GOLDEN * e
            else:
                e, move = move, p / q
            u = x + (
                move if abs(move) >= MAXIMUM_CORRECTION else (MAXIMUM_CORRECTION if move > 0.0 else -MAXIMUM_CORRECTION)
            )
            evaluate_at(d, step, u)
            fu = sign * d.w[place]
            if fu >= fx:
                a, b = (x, b) if u >= x else (a, x)
                third, f_third, second, f_second, x, fx = second, f_second, x, fx, u, fu
            else:
                a, b = (u, b) if u < x else (a, u)
                if fu >= f_second or second == x:
                    third, f_third, second, f_second = second, f_second, u, fu
                elif fu >= f_third or third in (x, second):
                    third, f_third = u, fu
        return fx, x

    return maximum
