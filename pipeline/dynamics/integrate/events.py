"""Contacts begin and end at located times; the impact rate is latched there, as state.

A closing is a gap that falls through zero, an opening one that rises through it. Both are looked
for in every accepted step, also when gap and penetration return within the step; the earliest is
located on the dense output, the step is repeated to end there, and the contact's mode changes.
What happens in between is followed by `trace`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate import crossings
from pipeline.dynamics.integrate.crossings import NEVER, clearance, turning, waving, zero_gap
from pipeline.dynamics.integrate.trace import compose as compose_trace
from pipeline.dynamics.integrate.trace import note, remember_end, watch
from pipeline.dynamics.kernels import kernel

#: mode changes at one and the same time before the solver gives up (Zeno)
MOST_IMMEDIATE = 200
#: what a contact does in a small share of a step is not where the dense output of the whole step has it;
#: the step is then repeated, at most so often, with this share of its length or more
MOST_SHORTENED, SHORTER = 8, 0.1
#: a contact that begins deeper than this share of its clearance, and so many tolerances, has been stepped over
DEEP, ERRORS = 1e-6, 100.0


@kernel
def start_watch(h, w):
    """Note what the contacts do where a segment starts, which has just been evaluated."""
    for c in range(h[m.N_CONTACTS]):
        o, now = watch(h, c), m.TOUCH.row(h, c)
        w[o + m.WATCH.gap0], w[o + m.WATCH.rate0] = w[now + m.TOUCH.gap], w[now + m.TOUCH.rate]
        w[o + m.WATCH.force0], w[o + m.WATCH.slip0], w[o + m.WATCH.slip_rate0] = (
            w[now + m.TOUCH.normal_force],
            w[now + m.TOUCH.slip],
            0.0,
        )


@kernel
def closed(h, n):
    """Whether some contact is closed."""
    found = False
    for c in range(h[m.N_CONTACTS]):
        found |= n[n[m.MODE] + c] == 1
    return found


@kernel
def straighten(h, w, c):
    """The bristles of a contact that begins bear nothing yet."""
    place = m.CONTACTS.bristle(h, c)
    if place >= 0:
        for k in range(3):
            w[h[m.Y_NEW] + place + k] = 0.0


@kernel
def switch(h, w, n, events, c, t):
    """Change the mode of contact c at time t, latch its impact rate, and write the event down."""
    o = watch(h, c)
    rate = w[o + m.WATCH.rate1]
    if n[n[m.MODE] + c] == 0:
        n[n[m.MODE] + c] = 1
        w[h[m.LATCHED] + c] = max(rate, 0.0)
        straighten(h, w, c)
        row = note(events, n, c, m.CLOSING, t)
        event = events[row]
        event[m.EVENT.speed], event[m.EVENT.peak_force], event[m.EVENT.peak_depth] = rate, 0.0, 0.0
        w[o + m.WATCH.event_row], w[o + m.WATCH.trend0] = row, m.STEEPLY
    else:
        n[n[m.MODE] + c] = 0
        ended = events[note(events, n, c, m.OPENING, t)]
        ended[m.EVENT.speed] = -rate
        begun = events[int(w[o + m.WATCH.event_row])]
        begun[m.EVENT.duration] = t - begun[m.EVENT.time]


@kernel
def give_up(n, status, c):
    """What settle returns when contact c ends the run."""
    n[m.STATUS], n[m.CULPRIT] = status, c
    return -1


def make_settle(
    evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any, regimes: Callable
) -> Callable:
    """The kernel settle(h, f, w, n, step, t_new, events) -> (event?, dense output ready?, end, step)."""
    interpolate, last = method.interpolate, method.last
    spare = method.slopes - 1  # row of SLOPES that no stage uses

    @kernel
    def peek(h, f, w, n, step, theta):
        """Evaluate the state at a share of the step."""
        interpolate(h, w, theta, h[m.Y_STAGE])
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + theta * step, h[m.Y_STAGE], h[m.SLOPES] + h[m.NY] * spare)
        n[m.EVALUATIONS] += 1

    trace = compose_trace(evaluate, peek, extend, method, regimes)
    find = crossings.compose(peek)

    @kernel
    def repeat(h, f, w, n, step):
        """Make the step again with another length, loops closed at its end; False when it cannot be done."""
        n[m.EVALUATIONS] += 1
        if not attempt(h, f, w, n, step):
            return False
        t, slope = w[h[m.CONTROL] + m.TIME] + step, h[m.SLOPES] + h[m.NY] * last
        evaluate(h, f, w, n, t, h[m.Y_NEW], slope)
        used = project(h, f, w, n, t, h[m.Y_NEW], slope, 1e-3 * w[h[m.CONTROL] + m.RTOL] * w[h[m.CONTROL] + m.LENGTH])
        n[m.EVALUATIONS] += max(used, 0)
        return used >= 0

    @kernel
    def end_at(h, f, w, n, step, c):
        """Repeat the step so that it ends on the event: its length, or -1 when that fails, and whether it is there."""
        for _ in range(3):
            if not repeat(h, f, w, n, step):
                return -1.0, False
            gap, rate = w[m.TOUCH.row(h, c) + m.TOUCH.gap], w[m.TOUCH.row(h, c) + m.TOUCH.rate]
            if abs(gap) <= zero_gap(h, f, w, c):
                return step, True
            if not abs(gap) < 0.1 * abs(rate) * step:
                return step, False
            step += gap / rate
        return step, True

    @kernel
    def first_event(h, f, w, n, step):
        """Contact and share of the step of its first mode change, and whether the dense output is ready."""
        ready, first, which = False, NEVER, -1
        for c in range(h[m.N_CONTACTS]):
            if not (turning(h, w, n, c) or waving(h, w, n, c, step)):
                continue
            if not ready:
                extend(h, f, w, n, step)
                ready = True
            theta = find(h, f, w, n, step, c)
            if theta < first:
                first, which = theta, c
        return which, first, ready

    @kernel
    def at_once(h, f, w, n, c, events):
        """A mode change where the step starts: no step is made."""
        n[m.IMMEDIATE] += 1
        t = w[h[m.CONTROL] + m.TIME]
        for k in range(h[m.NY]):
            w[h[m.Y_NEW] + k] = w[h[m.Y] + k]
        evaluate(h, f, w, n, t, h[m.Y_NEW], h[m.SLOPES] + h[m.NY] * last)
        n[m.EVALUATIONS] += 1
        o, now = h[m.CONTROL], m.TOUCH.row(h, c)
        if (
            w[now + m.TOUCH.gap] < -DEEP * clearance(h, f, c) - ERRORS * w[o + m.RTOL] * w[o + m.LENGTH]
            and n[n[m.MODE] + c] == 0
        ):
            return give_up(n, m.STEPPED_OVER, c)
        w[watch(h, c) + m.WATCH.rate1] = w[now + m.TOUCH.rate]
        switch(h, w, n, events, c, t)
        return give_up(n, m.STUCK_EVENT, c) if n[m.IMMEDIATE] > MOST_IMMEDIATE else 1

    @kernel
    def settle(h, f, w, n, step, t_new, events):
        t = w[h[m.CONTROL] + m.TIME]
        for shortened in range(MOST_SHORTENED + 1):
            remember_end(h, w)
            which, first, ready = first_event(h, f, w, n, step)
            if which < 0:
                n[m.IMMEDIATE] = 0
                return 0, trace(h, f, w, n, step, ready, events), t_new, step
            if first * step <= 1e-15 * max(abs(t), step):
                return at_once(h, f, w, n, which, events), True, t, step
            length, there = end_at(h, f, w, n, first * step, which)
            if length < 0.0:
                return give_up(n, m.LOST_CLOSURE, which), ready, t_new, step
            if there or shortened == MOST_SHORTENED:
                break
            step *= min(0.5, max(SHORTER, 2.0 * first))
            t_new = t + step
            if not repeat(h, f, w, n, step):
                return give_up(n, m.LOST_CLOSURE, which), ready, t_new, step
        n[m.IMMEDIATE] = 0
        remember_end(h, w)
        extend(h, f, w, n, length)  # before the mode changes: the outputs of this step belong to the old one
        trace(h, f, w, n, length, True, events)
        switch(h, w, n, events, which, t + length)
        return 1, True, t + length, length

    return settle


def watching(regimes: Callable) -> tuple[Callable, Callable, Callable]:
    """What the stepper calls at the start of a segment, the maker of what it calls after each step, and `closed`.

    regimes: whether contacts have regimes of sticking (`trace.regimes` or `trace.no_regimes`).
    """

    def make(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
        return make_settle(evaluate, attempt, extend, project, method, regimes)

    return start_watch, make, closed
