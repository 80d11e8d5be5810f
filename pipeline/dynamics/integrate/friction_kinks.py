"""Steps end where a friction law bends: at the sliding speeds at which its slope or its curvature jumps.

A step over such a kink has less derivatives than its method and its error estimate ask for, so that what it errs is
chance: at single tolerances ten times and more off the trend. Where an accepted step has passed a kink, it is made
again with its end there, as near as the tolerance asks; both sides are smooth. Nothing begins afresh.

Here is what all kinks share, and those of contacts; `joint_friction_kinks` has those of ideal joints, `load_kinks`
those of friction along joint coordinates.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.6
(discontinuous equations).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.stepper import none_closed, watch_nothing
from flexclear.pipeline.dynamics.integrate.within_step import make_evaluate_at, make_locate_level, make_repeat
from flexclear.pipeline.dynamics.kernels import kernel

#: how near to a kink a step ends, as a share of what it is measured by over the root of the tolerance: what a step errs
#: that ends so far beyond falls with the square of it
NEAR = 0.1
#: speeds per contact or bearing at which its law may bend
SPEEDS = 2
MOST_REPEATS = 3
#: a step that would be a smaller share of the tried one, or of the time reached, ends where it did
SHORTEST = 1e-12
#: what `first` gives where a step passes no kink
NONE = (2.0, -1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)


class Kinks(NamedTuple):
    """Kernels of a family of kinks.

    start(d), end(d): note what is watched at the start of a segment and at the end of a step, where it has just
    been evaluated; accept(d): that end is the start of the next one.
    first(d) -> (share, place, level, near, a, b, fa, fb): the kink that a step passes first, at about this
    share of it: where w[place] passes the level between the shares a and b, at which it is off by fa and fb (only known
    at the ends of the step); how near to the level is there; or NONE.
    """

    start: Callable
    end: Callable
    accept: Callable
    first: Callable


@kernel
def nearness(d, size):
    """How far from a kink counts as there, in what it is measured by, of this size."""
    return NEAR * np.sqrt(d.rtol) * size


@kernel
def passes(first, second, near):
    """Whether distances from a level at the ends of a step say that it is passed, while neither end lies on it."""
    return first * second < 0.0 and min(abs(first), abs(second)) > near


@kernel
def sooner(one, other):
    """Which of two kinks a step passes first."""
    return one if one[0] <= other[0] else other


@kernel
def first_of_contacts(d):
    """The kink that a closed contact passes first (`Kinks.first`)."""
    found = NONE
    for c in range(d.n_contacts):
        if d.mode[c] != 1:
            continue
        watch = d.watch[c]
        for k in range(SPEEDS):
            level = d.contact_numbers[c].kinks[k]
            first, second, near = watch.slip0 - level, watch.slip1 - level, nearness(d, level)
            if level > 0.0 and passes(first, second, near) and first / (first - second) < found[0]:
                share, place = first / (first - second), d.at_touch + m.TOUCH.size * c + m.TOUCH.slip
                found = (share, place, level, near, 0.0, 1.0, first, second)
    return found


#: what is watched of contacts anyway is enough
CONTACT_KINKS = Kinks(watch_nothing, watch_nothing, watch_nothing, first_of_contacts)


def _beside(one: Kinks, other: Kinks) -> Kinks:
    """Two families as one."""
    start_one, start_other, end_one, end_other = one.start, other.start, one.end, other.end
    accept_one, accept_other, first_one, first_other = one.accept, other.accept, one.first, other.first

    @kernel
    def start(d):
        start_one(d)
        start_other(d)

    @kernel
    def end(d):
        end_one(d)
        end_other(d)

    @kernel
    def accept(d):
        accept_one(d)
        accept_other(d)

    @kernel
    def first(d):
        return sooner(first_one(d), first_other(d))

    return Kinks(start, end, accept, first)


def together(kinks: tuple[Kinks, ...]) -> Kinks | None:
    """Families of kinks as one; None where there are none."""
    return reduce(_beside, kinks) if kinks else None


@kernel
def no_kinks(d, step, before, ready):
    """Steps end nowhere because of friction."""
    return 0.0


def make_end_on_kink(evaluate_at: Callable, extend: Callable, repeat: Callable, kinks: Kinks | None) -> Callable:
    """The kernel end_on_kink(d, step, before, ready): length of the step that ends on a kink instead.

    0 without one before a share of the step; -1 when the step cannot be made again. ready: the dense output.
    evaluate_at, repeat: of `within_step`.
    """
    if kinks is None:
        return no_kinks
    first_kink, locate_level = kinks.first, make_locate_level(evaluate_at)

    @kernel
    def value_at(d, step, theta, place, level):
        """How far beyond the level w[place] is at a share of the step."""
        evaluate_at(d, step, theta)
        return d.w[place] - level

    @kernel
    def land(d, step, theta, place, level, near, before, off_before):
        """Make the step end on the level, from a first guess: its length; -1 when it cannot be made.

        before, off_before: another share of the step, and how far beyond the level it is.
        """
        length, before = theta * step, before * step
        for k in range(MOST_REPEATS):
            if not repeat(d, length):
                return -1.0
            off = d.w[place] - level
            if abs(off) <= near or k == MOST_REPEATS - 1 or off == off_before:
                return length
            better = length - off * (length - before) / (off - off_before)
            if not 0.0 < better < step:
                return length
            before, off_before, length = length, off, better
        return length

    @kernel
    def end_on_kink(d, step, before, ready):
        share, place, level, near, a, b, fa, fb = first_kink(d)
        if not share < before:
            return 0.0
        if not ready:
            extend(d, step)
        if a > 0.0:
            fa = value_at(d, step, a, place, level)
        if b < 1.0:
            fb = value_at(d, step, b, place, level)
        if fa * fb >= 0.0:  # the way to it is bent
            return 0.0
        theta = locate_level(d, step, place, level, near, a, b, fa, fb)
        if not theta < before or theta * step <= SHORTEST * max(abs(d.time), step):
            return 0.0
        length = land(d, step, theta, place, level, near, a, fa)
        if length < 0.0:
            return 0.0 if repeat(d, step) else -1.0
        return length

    return end_on_kink


def kinks_alone(*families: Kinks) -> tuple[Callable, Callable, Callable]:
    """`events` of scenes with kinks and without contacts, as `contact_events.located` gives them."""
    kinks = reduce(_beside, families)
    start, end, accept = kinks.start, kinks.end, kinks.accept

    def make(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
        evaluate_at, repeat = make_evaluate_at(evaluate, method), make_repeat(evaluate, attempt, project, method)
        end_on_kink = make_end_on_kink(evaluate_at, extend, repeat, kinks)

        @kernel
        def resolve_events(d, step, t_new, rows, events):
            end(d)
            length = end_on_kink(d, step, 1.0, False)
            if length < 0.0:
                d.status = m.LOST_CLOSURE
                return -1, False, t_new, step
            if length == 0.0:
                accept(d)
                return 0, False, t_new, step
            end(d)
            accept(d)
            return 0, False, d.time + length, length

        return resolve_events

    return start, make, none_closed
