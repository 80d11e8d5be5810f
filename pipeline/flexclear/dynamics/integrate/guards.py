"""Steps end on the guards of a mechanism: levels and reversals of the vectors on which forces depend.

There the slope or the curvature of a friction law jumps, at sliding speeds that the law names, and loads on joints
reverse, of which friction takes the magnitudes. A step over such a kink has fewer derivatives than its method and its
error estimate need, so its error is a matter of chance: at single tolerances ten times and more off the trend. When an
accepted step has passed a guard, it is repeated to end there, as close as the tolerance demands; both sides are smooth.
Integration does not restart.

A guard watches a vector (`model.guards`), and assumes a straight path from the start of a step to its end. So the speed
of a joint that reverses between two equal magnitudes still passes its levels in between.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.6
(discontinuous equations).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.tuples import add, dot, scale, sub
from flexclear.dynamics.integrate.stepper import never
from flexclear.dynamics.integrate.within_step import make_evaluate_at, make_locate, make_repeat
from flexclear.dynamics.kernels import kernel

#: how close to its level a guard ends a step, as a fraction of the guard's size over the root of the tolerance: the
#: error of a step that ends so far beyond falls with the square of it
LEVEL_DISTANCE = 0.1
MOST_REPEATS = 3
#: returned by `first_passed` when a step passes no guard
NONE = (2.0, -1, 0.0, 1.0, 0.0, 0.0)


@kernel
def length(v):
    """Return the length of a vector."""
    return np.sqrt(dot(v, v))


@kernel
def watched_vector(d, g):
    """Return the vector that guard g watches, in the state evaluated last, padded with zeros."""
    guard = d.guards[g]
    o = d.h[guard.table] + guard.offset
    return d.w[o], d.w[o + 1] if guard.components > 1 else 0.0, d.w[o + 2] if guard.components > 2 else 0.0


@kernel
def note_start(d):
    """Store the watched vectors at the start of a segment."""
    for g in range(d.n_guards):
        d.guarded[g].start = watched_vector(d, g)


@kernel
def note_end(d):
    """Store the watched vectors at the end of a step."""
    for g in range(d.n_guards):
        d.guarded[g].end = watched_vector(d, g)


@kernel
def accept(d):
    """Make the end of an accepted step the start of the next."""
    for g in range(d.n_guards):
        d.guarded[g].start = d.guarded[g].end


@kernel
def beyond(d, g):
    """Return how far the vector of guard g is beyond its level; for a reversal, its component along its change."""
    level, v = d.guard_numbers[g].level, watched_vector(d, g)
    if level > 0.0:
        return length(v) - level
    way = sub(d.guarded[g].end, d.guarded[g].start)
    return dot(v, way) / length(way)


@kernel
def closeness(d, g):
    """Return the distance from its level at which guard g counts as reached, from its scale or the step's change."""
    numbers, bearing = d.guard_numbers[g], d.guards[g].bearing
    if bearing < 0 and numbers.scale == 0.0:
        return LEVEL_DISTANCE * np.sqrt(d.rtol) * length(sub(d.guarded[g].end, d.guarded[g].start))
    return LEVEL_DISTANCE * np.sqrt(d.rtol) * (d.bearing[bearing].load if bearing >= 0 else numbers.scale)


@kernel
def closest(start, end):
    """Return the fraction of the straight way between two vectors where it is closest to zero, and the vector there."""
    way = sub(end, start)
    square = dot(way, way)
    theta = -dot(way, start) / square if square > 0.0 else 0.0
    return theta, add(start, scale(theta, way))


@kernel
def passage(d, g):
    """Return (fraction, g, a, b, fa, fb): the step passes guard g at about this fraction, between fractions a and b.

    It is off by fa and fb there, which only is known at the ends of the step.  NONE where it does not pass, or where an
    end of the step lies on the level.
    """
    at, level, close = d.guarded[g], d.guard_numbers[g].level, closeness(d, g)
    theta, there = closest(at.start, at.end)
    inside, within, first, second = length(there), 0.0 < theta < 1.0, length(at.start), length(at.end)
    if level == 0.0:
        way = length(sub(at.end, at.start))
        # a vector that passes zero within this fraction of its change reverses: in a plane mechanism the rest is
        # rounding
        if not (within and inside <= 1e-6 * way and min(first, second) > close):
            return NONE
        return theta, g, 0.0, 1.0, -first, second
    first, second, inside = first - level, second - level, inside - level
    if first * second < 0.0 and min(abs(first), abs(second)) > close:
        return first / (first - second), g, 0.0, 1.0, first, second
    dips = within and inside < -close
    if dips and first > close:
        return theta * first / (first - inside), g, 0.0, theta, first, inside
    if dips and second > close:
        return 1.0 - (1.0 - theta) * second / (second - inside), g, theta, 1.0, inside, second
    return NONE


@kernel
def first_passed(d):
    """Return the passage of the guard that a step passes first, or NONE; open contacts have no guards."""
    first = NONE
    for g in range(d.n_guards):
        contact = d.guards[g].contact
        if contact < 0 or d.mode[contact] == 1:
            passed = passage(d, g)
            first = passed if passed[0] < first[0] else first
    return first


def make_end_on_guard(evaluate_at: Callable, extend: Callable, repeat: Callable) -> Callable:
    """Build the kernel end_on_guard(d, step, before, ready), which repeats a step to end on a guard.

    It returns the new length: 0 without a guard before that fraction of the step, -1 when the step cannot be repeated.
    ready: whether the dense output is prepared.
    evaluate_at, repeat: of `within_step`.
    """

    @kernel
    def beyond_at(d, step, theta, g):
        """Return how far guard g is beyond its level at a fraction of the step."""
        evaluate_at(d, step, theta)
        return beyond(d, g)

    locate = make_locate(beyond_at)

    @kernel
    def land(d, step, theta, g, close, before, off_before):
        """Repeat the step to end on the level, from a first guess; return its length, or -1 when that fails.

        before, off_before: another fraction of the step, and how far beyond the level it is.
        """
        size, before = theta * step, before * step
        for k in range(MOST_REPEATS):
            if not repeat(d, size):
                return -1.0
            off = beyond(d, g)
            if abs(off) <= close or k == MOST_REPEATS - 1 or off == off_before:
                return size
            better = size - off * (size - before) / (off - off_before)
            if not 0.0 < better < step:
                return size
            before, off_before, size = size, off, better
        return size

    @kernel
    def end_on_guard(d, step, before, ready):
        about, g, a, b, fa, fb = first_passed(d)
        if not about < before:
            return 0.0
        if not ready:
            extend(d, step)
        if a > 0.0:
            fa = beyond_at(d, step, a, g)
        if b < 1.0:
            fb = beyond_at(d, step, b, g)
        if fa * fb >= 0.0:  # the way to it is bent
            return 0.0
        close = closeness(d, g)
        theta = locate(d, step, g, 0.0, close, a, b, fa, fb)
        # a repeated step that would be a smaller fraction of the first one, or of the time reached, is not made
        if not theta < before or theta * step <= 1e-12 * max(abs(d.time), step):
            return 0.0
        size = land(d, step, theta, g, close, a, fa)
        if size < 0.0:
            return 0.0 if repeat(d, step) else -1.0
        return size

    return end_on_guard


def make_resolve_events(
    evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any
) -> Callable:
    """Build the kernel resolve_events for guards without contacts (see `contact_events.make_resolve_events`)."""
    evaluate_at, repeat = make_evaluate_at(evaluate, method), make_repeat(evaluate, attempt, project, method)
    end_on_guard = make_end_on_guard(evaluate_at, extend, repeat)

    @kernel
    def resolve_events(d, step, t_new, rows, events):
        note_end(d)
        size = end_on_guard(d, step, 1.0, False)
        if size < 0.0:
            d.status = m.LOST_CLOSURE
            return -1, False, t_new, step
        if size > 0.0:
            note_end(d)
            step, t_new = size, d.time + size
        accept(d)
        return 0, False, t_new, step

    return resolve_events


#: `events` of such scenes, as `contact_events.located` gives them, and what that takes where there are contacts as well
GUARDS = (note_start, make_resolve_events, never)
AMONG_CONTACTS = (note_start, note_end, accept, make_end_on_guard)
