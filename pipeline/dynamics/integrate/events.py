"""Contacts begin and end at located times; the impact rate is latched there, as state.

A closing is a gap that falls through zero, an opening one that rises through it. Both are looked
for in every accepted step, also when gap and penetration return within the step; the earliest is
located on the dense output, the step is repeated to end there, and the contact's mode changes.
What happens in between is followed by `trace`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.dynamics.integrate import crossings
from pipeline.dynamics.integrate.crossings import NEVER, clearance, turning, waving, zero_gap
from pipeline.dynamics.integrate.state import (
    CLOSING,
    CULPRIT,
    DURATION,
    EVALUATIONS,
    EVENT_ROW,
    EVENT_TIME,
    FORCE0,
    GAP0,
    IMMEDIATE,
    LENGTH,
    LOST_CLOSURE,
    OPENING,
    PEAK_DEPTH,
    PEAK_FORCE,
    RATE0,
    RATE1,
    RTOL,
    SLIP0,
    SLIP_RATE0,
    SPEED,
    STATUS,
    STEEPLY,
    STEPPED_OVER,
    STUCK_EVENT,
    TIME,
    TREND0,
)
from pipeline.dynamics.integrate.trace import compose as compose_trace
from pipeline.dynamics.integrate.trace import note, remember_end, watch
from pipeline.dynamics.tables import (
    BRISTLE,
    CONTROL,
    GAP,
    LATCHED,
    MODE,
    N_CONTACTS,
    NORMAL_FORCE,
    NY,
    RATE,
    SLIP,
    SLOPES,
    Y_NEW,
    Y_STAGE,
    Y,
    contact,
    touch,
)
from pipeline.dynamics.vectors import kernel

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
    for c in range(h[N_CONTACTS]):
        o, now = watch(h, c), touch(h, c)
        w[o + GAP0], w[o + RATE0] = w[now + GAP], w[now + RATE]
        w[o + FORCE0], w[o + SLIP0], w[o + SLIP_RATE0] = w[now + NORMAL_FORCE], w[now + SLIP], 0.0


@kernel
def closed(h, n):
    """Whether some contact is closed."""
    found = False
    for c in range(h[N_CONTACTS]):
        found |= n[n[MODE] + c] == 1
    return found


@kernel
def straighten(h, w, c):
    """The bristles of a contact that begins bear nothing yet."""
    place = contact(h, c, BRISTLE)
    if place >= 0:
        for k in range(3):
            w[h[Y_NEW] + place + k] = 0.0


@kernel
def switch(h, w, n, events, c, t):
    """Change the mode of contact c at time t, latch its impact rate, and write the event down."""
    o = watch(h, c)
    rate = w[o + RATE1]
    if n[n[MODE] + c] == 0:
        n[n[MODE] + c] = 1
        w[h[LATCHED] + c] = max(rate, 0.0)
        straighten(h, w, c)
        row = note(events, n, c, CLOSING, t)
        event = events[row]
        event[SPEED], event[PEAK_FORCE], event[PEAK_DEPTH] = rate, 0.0, 0.0
        w[o + EVENT_ROW], w[o + TREND0] = row, STEEPLY
    else:
        n[n[MODE] + c] = 0
        ended = events[note(events, n, c, OPENING, t)]
        ended[SPEED] = -rate
        begun = events[int(w[o + EVENT_ROW])]
        begun[DURATION] = t - begun[EVENT_TIME]


@kernel
def give_up(n, status, c):
    """What settle returns when contact c ends the run."""
    n[STATUS], n[CULPRIT] = status, c
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
        interpolate(h, w, theta, h[Y_STAGE])
        evaluate(h, f, w, n, w[h[CONTROL] + TIME] + theta * step, h[Y_STAGE], h[SLOPES] + h[NY] * spare)
        n[EVALUATIONS] += 1

    trace = compose_trace(evaluate, peek, extend, method, regimes)
    find = crossings.compose(peek)

    @kernel
    def repeat(h, f, w, n, step):
        """Make the step again with another length, loops closed at its end; False when it cannot be done."""
        n[EVALUATIONS] += 1
        if not attempt(h, f, w, n, step):
            return False
        t, slope = w[h[CONTROL] + TIME] + step, h[SLOPES] + h[NY] * last
        evaluate(h, f, w, n, t, h[Y_NEW], slope)
        used = project(h, f, w, n, t, h[Y_NEW], slope, 1e-3 * w[h[CONTROL] + RTOL] * w[h[CONTROL] + LENGTH])
        n[EVALUATIONS] += max(used, 0)
        return used >= 0

    @kernel
    def end_at(h, f, w, n, step, c):
        """Repeat the step so that it ends on the event: its length, or -1 when that fails, and whether it is there."""
        for _ in range(3):
            if not repeat(h, f, w, n, step):
                return -1.0, False
            gap, rate = w[touch(h, c) + GAP], w[touch(h, c) + RATE]
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
        for c in range(h[N_CONTACTS]):
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
        n[IMMEDIATE] += 1
        t = w[h[CONTROL] + TIME]
        for k in range(h[NY]):
            w[h[Y_NEW] + k] = w[h[Y] + k]
        evaluate(h, f, w, n, t, h[Y_NEW], h[SLOPES] + h[NY] * last)
        n[EVALUATIONS] += 1
        o, now = h[CONTROL], touch(h, c)
        if w[now + GAP] < -DEEP * clearance(h, f, c) - ERRORS * w[o + RTOL] * w[o + LENGTH] and n[n[MODE] + c] == 0:
            return give_up(n, STEPPED_OVER, c)
        w[watch(h, c) + RATE1] = w[now + RATE]
        switch(h, w, n, events, c, t)
        return give_up(n, STUCK_EVENT, c) if n[IMMEDIATE] > MOST_IMMEDIATE else 1

    @kernel
    def settle(h, f, w, n, step, t_new, events):
        t = w[h[CONTROL] + TIME]
        for shortened in range(MOST_SHORTENED + 1):
            remember_end(h, w)
            which, first, ready = first_event(h, f, w, n, step)
            if which < 0:
                n[IMMEDIATE] = 0
                return 0, trace(h, f, w, n, step, ready, events), t_new, step
            if first * step <= 1e-15 * max(abs(t), step):
                return at_once(h, f, w, n, which, events), True, t, step
            length, there = end_at(h, f, w, n, first * step, which)
            if length < 0.0:
                return give_up(n, LOST_CLOSURE, which), ready, t_new, step
            if there or shortened == MOST_SHORTENED:
                break
            step *= min(0.5, max(SHORTER, 2.0 * first))
            t_new = t + step
            if not repeat(h, f, w, n, step):
                return give_up(n, LOST_CLOSURE, which), ready, t_new, step
        n[IMMEDIATE] = 0
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
