"""Location of a contact's mode change within a step.

The ends of a step give gap and rate. Between them a long step of free flight may contain several turning points of the
gap, so the cubic through both ends is examined, too. If it permits a mode change, the dense output is searched from its
start on, in intervals so short that cubics describe the gap: a step of free bodies is as long as their motion is
smooth, in which a ball travels many times its clearance and its gap, a length, has many extremes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics.equations.tuples import dot, sub
from flexclear.dynamics.integrate.within_step import ROOT_CORRECTION
from flexclear.dynamics.kernels import kernel

ROOT_ITERATIONS, TURN_ITERATIONS = 60, 40
#: returned in place of a fraction of the step when the mode does not change
NO_CHANGE = 2.0
#: a step with a possible mode change is searched in intervals of at most this fraction. They are halved while the cubic
#: through an interval's ends misses its middle by more than this fraction of its departure, and of the distance before
#: the mode change (that behind it may be thousands of times larger), and while the ball travels more than its
#: clearance, which the gap need not show
WIDEST_STRETCH, FAITHFUL = 0.25, 0.05
#: to this fraction: even the rate of a gap jumps where a ball passes the centre of its socket
SHORTEST = 2.0**-13


@kernel
def side(d, c):
    """Return +1 for an open contact, whose gap falls to an event; -1 for a closed one, whose penetration does."""
    return 1.0 if d.mode[c] == 0 else -1.0


@kernel
def zero_gap(d, c):
    """Return the size [m] below which the gap of contact c counts as zero."""
    # a gap is zero below this fraction of the clearance plus this one, four roundings, of the mechanism's size: a
    # difference of the sites' positions has no digits below, which matters where clearances are of micrometres
    return 1e-12 * d.contact_numbers[c].clearance + 8.9e-16 * d.length


@kernel
def distance_between(a, b):
    """Return the distance of two points."""
    between = sub(a, b)
    return np.sqrt(dot(between, between))


@kernel
def cubic_middle(d0, d1, r0, r1):
    """Return Hermite's cubic in the middle, from values and rates (per length of the interval) at both ends."""
    return 0.5 * (d0 + d1) + 0.125 * (r0 - r1)


@kernel
def cubic_least(d0, d1, r0, r1):
    """Return the least value of Hermite's cubic at the quarters."""
    first = (54.0 * d0 + 10.0 * d1 + 9.0 * r0 - 3.0 * r1) / 64.0
    last = (10.0 * d0 + 54.0 * d1 + 3.0 * r0 - 9.0 * r1) / 64.0
    return min(cubic_middle(d0, d1, r0, r1), min(first, last))


@kernel
def cubic_departure(d0, d1, r0, r1):
    """Return how far Hermite's cubic departs from a straight line."""
    return abs(r0 - (d1 - d0)) + abs(r1 - (d1 - d0))


@kernel
def ends_tell(d, c):
    """Return True when the ends of a step show a mode change, or a turning point that may contain one."""
    watch, s = d.watch[c], side(d, c)
    return s * watch.gap1 < 0.0 or (s * watch.rate0 > 0.0 and s * watch.rate1 <= 0.0)


@kernel
def cubic_tells(d, c, step):
    """Return True when the distance to the mode change may become negative inside, by the cubic through both ends."""
    watch, s = d.watch[c], side(d, c)
    d0, d1 = s * watch.gap0, s * watch.gap1
    r0, r1 = -s * watch.rate0 * step, -s * watch.rate1 * step
    # assumed error of the cubic through a step's ends, as a fraction of its departure from a straight line; in long
    # steps of order 8 its error is a tenth of that
    return cubic_least(d0, d1, r0, r1) < 0.2 * cubic_departure(d0, d1, r0, r1)


def make_locate_change(evaluate_at: Callable) -> Callable:
    """Build the kernel locate_change(d, step, c), for use after `ends_tell` or `cubic_tells`.

    It returns the fraction of the step where contact c changes its mode: 0 at once, NO_CHANGE not at all.
    evaluate_at(d, step, theta): evaluates the dense output at a fraction of the step.
    """

    @kernel
    def distance_at(d, step, theta, c):
        """Return distance to the mode change (gap if open, penetration if closed) and its rate per step."""
        evaluate_at(d, step, theta)
        return side(d, c) * d.touch[c].gap, -side(d, c) * d.touch[c].rate * step

    @kernel
    def turning_point(d, step, c, sign, low, high):
        """Return the fraction of the step at the first minimum of sign * distance, or at the first negative value met.

        With sign -1 the distance rises from zero and is negative at the end: its first rise and fall lie before any
        negative value.
        """
        zero, theta, last = zero_gap(d, c), low, 0
        at_low = at_high = 0.0  # rates there, zero while they are not known
        for _ in range(TURN_ITERATIONS):
            before, share = theta, 0.5
            if at_low < 0.0 < at_high:
                share = at_low / (at_low - at_high)
            theta = low + share * (high - low)
            value, rate = distance_at(d, step, theta, c)
            if sign * value < -zero or abs(theta - before) <= ROOT_CORRECTION:
                return theta
            if sign * rate > 0.0 or (sign < 0.0 and value < 0.0):
                high, at_high = theta, max(sign * rate, 0.0)
                at_low *= 0.5 if last == 1 else 1.0  # the Illinois rule
                last = 1
            else:
                low, at_low = theta, sign * rate
                at_high *= 0.5 if last == -1 else 1.0
                last = -1
        return theta

    @kernel
    def root(d, step, c, low, high):
        """Return the fraction of the step where the distance falls through zero, given > 0 at low and < 0 at high."""
        theta, enough = 0.5 * (low + high), 1e-3 * zero_gap(d, c)
        for _ in range(ROOT_ITERATIONS):
            value, rate = distance_at(d, step, theta, c)
            if value > 0.0:
                low = theta
            else:
                high = theta
            if abs(value) <= enough or high - low <= 1e-15:
                return theta
            newton = theta - value / rate if rate < 0.0 else -1.0
            theta = newton if low < newton < high else 0.5 * (low + high)
        return theta

    @kernel
    def change_within(d, step, c, low, high, start, falling, end, rising):
        """Return the first mode change between two fractions with at most one turning point between them, or NO_CHANGE.

        start, end: distances there; falling, rising: whether they fall at the first, and rise at the second.
        """
        zero = zero_gap(d, c)
        if end < -zero:
            if start > zero:
                return root(d, step, c, low, high)
            if falling:
                return low
            top = turning_point(d, step, c, -1.0, low, high)
            value, _ = distance_at(d, step, top, c)
            return root(d, step, c, top, high) if value > zero else low
        if falling and rising:
            bottom = turning_point(d, step, c, 1.0, low, high)
            value, _ = distance_at(d, step, bottom, c)
            if value < -zero:
                return root(d, step, c, low, bottom) if start > zero else low
        return NO_CHANGE

    @kernel
    def search(d, step, c):
        """Return the first mode change in the step, interval by interval: 0 at once, NO_CHANGE not at all."""
        zero, room = zero_gap(d, c), d.contact_numbers[c].clearance
        d0, r0 = distance_at(d, step, 0.0, c)
        p0 = d.touch[c].offset
        d1, r1 = distance_at(d, step, WIDEST_STRETCH, c)
        p1 = d.touch[c].offset
        low, high = 0.0, WIDEST_STRETCH
        while True:
            width, middle = high - low, 0.5 * (low + high)
            dm, r = distance_at(d, step, middle, c)
            p = d.touch[c].offset
            half, missed = 0.5 * width, abs(dm - cubic_middle(d0, d1, width * r0, width * r1))
            least = min(cubic_least(d0, dm, half * r0, half * r), cubic_least(dm, d1, half * r, half * r1))
            bend = cubic_departure(d0, d1, width * r0, width * r1)
            # by more than this fraction of its departure, a cubic may be lower between the quarters of its halves
            if not min(least, min(dm, d1)) > missed + 0.05 * bend:
                near = FAITHFUL * min(bend, max(d0, max(dm, d1))) + zero
                known = missed <= near and distance_between(p0, p) + distance_between(p, p1) <= room
                if width > SHORTEST and not known:
                    high, d1, r1, p1 = middle, dm, r, p
                    continue
                theta = change_within(d, step, c, low, middle, d0, r0 < 0.0, dm, r >= 0.0)
                if theta == NO_CHANGE:
                    theta = change_within(d, step, c, middle, high, dm, r < 0.0, d1, r1 >= 0.0)
                if theta != NO_CHANGE:
                    return theta
            if high >= 1.0:
                return NO_CHANGE
            low, d0, r0, p0 = high, d1, r1, p1
            high = min(low + min(2.0 * width, WIDEST_STRETCH), 1.0)
            d1, r1 = distance_at(d, step, high, c)
            p1 = d.touch[c].offset

    @kernel
    def locate_change(d, step, c):
        if cubic_tells(d, c, step):
            return search(d, step, c)
        watch, s = d.watch[c], side(d, c)
        start, falling = s * watch.gap0, s * watch.rate0 > 0.0
        end, rising = s * watch.gap1, s * watch.rate1 <= 0.0
        return change_within(d, step, c, 0.0, 1.0, start, falling, end, rising)

    return locate_change
