"""Steps end where a friction law bends: at the sliding speeds at which its slope or its curvature jumps.

A step over such a kink has less derivatives than its method and its error estimate ask for, so that what it errs is
chance: at single tolerances ten times and more off the trend. Where an accepted step has passed a kink, it is made
again with its end there, as near as the tolerance asks; both sides are smooth. Nothing begins afresh.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.6
(discontinuous equations).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.contact_phases import no_regimes
from flexclear.pipeline.dynamics.kernels import kernel

#: how near to a kink a step ends, as a share of its speed over the root of the tolerance: what a step errs that ends so
#: far beyond falls with the square of it
NEAR = 0.1
#: speeds per contact at which its law may bend
SPEEDS = 2
MOST_LOOKS, MOST_REPEATS = 20, 3
#: a step that would be a smaller share of the tried one, or of the time reached, ends where it did
SHORTEST = 1e-12


@kernel
def nearness(h, w, level):
    """How far from a kink [m/s] counts as there."""
    return NEAR * np.sqrt(w[h[m.CONTROL] + m.RTOL]) * level


@kernel
def passes(w, o, level, near):
    """Whether the sliding speed passes a level between the ends of a step neither of which lies on it."""
    first, second = w[o + m.WATCH.slip0] - level, w[o + m.WATCH.slip1] - level
    return first * second < 0.0 and min(abs(first), abs(second)) > near


@kernel
def first_kink(h, f, w, n, before):
    """Contact that passes a kink first, before a share of the step, and the speed of the kink; -1 without one."""
    which, speed, least = -1, 0.0, before
    for c in range(h[m.N_CONTACTS]):
        if n[n[m.MODE] + c] != 1:
            continue
        o, kinks = m.WATCH.row(h, c), m.CONTACT_NUMBERS.row(h, c) + m.CONTACT_NUMBERS.kinks
        for k in range(SPEEDS):
            level = f[kinks + k]
            if not level > 0.0 or not passes(w, o, level, nearness(h, w, level)):
                continue
            share = (w[o + m.WATCH.slip0] - level) / (w[o + m.WATCH.slip0] - w[o + m.WATCH.slip1])
            if share < least:
                which, speed, least = c, level, share
    return which, speed


@kernel
def no_kinks(h, f, w, n, step, before, ready):
    """Steps end nowhere because of friction."""
    return 0.0


def make_end_on_kink(evaluate_at: Callable, extend: Callable, repeat: Callable, regimes: Callable) -> Callable:
    """The kernel end_on_kink(h, f, w, n, step, before, ready): length of the step that ends on a kink instead.

    0 without one before a share of the step; -1 when the step cannot be made again. ready: the dense output.
    evaluate_at, repeat: of `contact_events`.  regimes: tells whether any contact has friction.
    """
    if regimes is no_regimes:
        return no_kinks

    @kernel
    def share_of_kink(h, f, w, n, step, c, level):
        """Share of the step at which the sliding speed of contact c reaches a level, on the dense output."""
        o, slip, near = m.WATCH.row(h, c), m.TOUCH.row(h, c) + m.TOUCH.slip, nearness(h, w, level)
        a, b, fa, fb, side = 0.0, 1.0, w[o + m.WATCH.slip0] - level, w[o + m.WATCH.slip1] - level, 0
        theta = 0.5
        for _ in range(MOST_LOOKS):
            theta = (a * fb - b * fa) / (fb - fa)
            evaluate_at(h, f, w, n, step, theta)
            value = w[slip] - level
            if abs(value) <= near:
                return theta
            if (value > 0.0) == (fb > 0.0):
                b, fb = theta, value
                fa, side = (0.5 * fa, 1) if side == 1 else (fa, 1)
            else:
                a, fa = theta, value
                fb, side = (0.5 * fb, -1) if side == -1 else (fb, -1)
        return theta

    @kernel
    def land(h, f, w, n, step, theta, c, level):
        """Make the step end on the level, from a first guess: its length; -1 when it cannot be made."""
        slip, near = m.TOUCH.row(h, c) + m.TOUCH.slip, nearness(h, w, level)
        length, before, off_before = theta * step, 0.0, w[m.WATCH.row(h, c) + m.WATCH.slip0] - level
        for k in range(MOST_REPEATS):
            if not repeat(h, f, w, n, length):
                return -1.0
            off = w[slip] - level
            if abs(off) <= near or k == MOST_REPEATS - 1 or off == off_before:
                return length
            better = length - off * (length - before) / (off - off_before)
            if not 0.0 < better < step:
                return length
            before, off_before, length = length, off, better
        return length

    @kernel
    def end_on_kink(h, f, w, n, step, before, ready):
        if w[h[m.CONTROL] + m.FIXED] > 0.0:
            return 0.0
        c, level = first_kink(h, f, w, n, before)
        if c < 0:
            return 0.0
        if not ready:
            extend(h, f, w, n, step)
        theta = share_of_kink(h, f, w, n, step, c, level)
        if not theta < before or theta * step <= SHORTEST * max(abs(w[h[m.CONTROL] + m.TIME]), step):
            return 0.0
        length = land(h, f, w, n, step, theta, c, level)
        if length < 0.0:
            return 0.0 if repeat(h, f, w, n, step) else -1.0
        return length

    return end_on_kink
