"""Contacts begin and end at located times; the impact rate is latched there, as state.

A closing is a gap that falls through zero, an opening a penetration that does. Both are looked for in every accepted
step, also when gap and penetration return within the step; the earliest is located on the dense output, the step is
repeated to end there, and the contact's mode changes. What happens in between is followed by `contact_phases`, where
in a step a mode changes by `mode_changes`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.contact_phases import make_follow_contacts, watch_end
from flexclear.pipeline.dynamics.integrate.friction_kinks import Kinks, make_end_on_kink, together
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.integrate.mode_changes import (
    NEVER,
    clearance,
    cubic_tells,
    ends_tell,
    make_locate_change,
    side,
    zero_gap,
)
from flexclear.pipeline.dynamics.integrate.recording import add_event
from flexclear.pipeline.dynamics.integrate.stepper import AGAIN, RESTART, watch_nothing
from flexclear.pipeline.dynamics.integrate.within_step import make_evaluate_at, make_repeat
from flexclear.pipeline.dynamics.kernels import kernel

#: mode changes at one and the same time before the solver gives up (Zeno)
MOST_IMMEDIATE = 200
#: what a contact does in a small share of a step is not where the dense output of the whole step has it;
#: the step is then repeated, at most so often, with this share of its length or more
MOST_SHORTENED, SHORTER = 8, 0.1
#: a contact that begins deeper than this share of its clearance, and so many tolerances, has been stepped over
DEEP, ERRORS = 1e-6, 100.0
#: share of its length by which a step may miss the event that it is to end on
CLOSE = 1e-6
#: a contact that would end where it has just begun is looked at in shorter steps, down to one in which it moves by so
#: many times what its gap is off zero
FURTHER = 10.0


# Modes ---------------------------------------------------------------------------------------------------------------
@kernel
def watch_start(h, w):
    """Note what the contacts do where a segment starts, which has just been evaluated."""
    for c in range(h[m.N_CONTACTS]):
        o, now = m.WATCH.row(h, c), m.TOUCH.row(h, c)
        w[o + m.WATCH.gap0], w[o + m.WATCH.rate0] = w[now + m.TOUCH.gap], w[now + m.TOUCH.rate]
        w[o + m.WATCH.force0], w[o + m.WATCH.slip0] = w[now + m.TOUCH.normal_force], w[now + m.TOUCH.slip]
        w[o + m.WATCH.slip_rate0] = 0.0


@kernel
def any_closed(h, n):
    """Whether some contact is closed."""
    result = False
    for c in range(h[m.N_CONTACTS]):
        result |= n[n[m.MODE] + c] == 1
    return result


@kernel
def relax_bristles(h, w, c):
    """The bristles of a contact that begins bear nothing yet."""
    place = m.CONTACTS.bristle(h, c)
    if place >= 0:
        for k in range(3):
            w[h[m.Y_NEW] + place + k] = 0.0


@kernel
def change_mode(h, w, n, events, c, t):
    """Change the mode of contact c at time t, latch its impact rate, and write the event down."""
    o = m.WATCH.row(h, c)
    rate = w[o + m.WATCH.rate1]
    if n[n[m.MODE] + c] == 0:
        n[n[m.MODE] + c] = 1
        w[h[m.LATCHED] + c] = max(rate, 0.0)
        relax_bristles(h, w, c)
        row = add_event(events, n, c, m.CLOSING, t)
        event = events[row]
        event[m.EVENT.speed], event[m.EVENT.peak_force], event[m.EVENT.peak_depth] = rate, 0.0, 0.0
        w[o + m.WATCH.event_row], w[o + m.WATCH.trend0] = row, m.STEEPLY
    else:
        n[n[m.MODE] + c] = 0
        ended = events[add_event(events, n, c, m.OPENING, t)]
        ended[m.EVENT.speed] = -rate
        begun = events[int(w[o + m.WATCH.event_row])]
        begun[m.EVENT.duration] = t - begun[m.EVENT.time]


# Events of a step ----------------------------------------------------------------------------------------------------
@kernel
def give_up(n, status, c):
    """What resolve_events returns when contact c ends the run."""
    n[m.STATUS], n[m.CULPRIT] = status, c
    return -1


@kernel
def try_again(n, c):
    """What it returns when the step cannot be made with its end on an event of contact c."""
    give_up(n, m.LOST_CLOSURE, c)
    return AGAIN


@kernel
def stepped_over(h, f, w, n, c):
    """Whether contact c, about to change its mode where a step starts, has begun long before."""
    gap, length = w[m.TOUCH.row(h, c) + m.TOUCH.gap], f[m.CONTACT_NUMBERS.row(h, c) + m.CONTACT_NUMBERS.length]
    deep = DEEP * clearance(h, f, c) + ERRORS * w[h[m.CONTROL] + m.RTOL] * length
    return gap < -deep and n[n[m.MODE] + c] == 0


@kernel
def backwards(h, w, n, c, rate):
    """Whether contact c would change its mode on the way back: a graze that a shorter step is to decide.

    Steps of a chosen length, and polynomials, cannot be made shorter.
    """
    o = h[m.CONTROL]
    return side(n, c) * rate < 0.0 and w[o + m.FIXED] == 0.0 and w[o + m.COLLOCATED] == 0.0


@kernel
def resolvable(h, f, w, c, step):
    """Whether contact c moves further in a step than its gap at the start is uncertain."""
    o = m.WATCH.row(h, c)
    return abs(w[o + m.WATCH.rate0]) * step > FURTHER * max(abs(w[o + m.WATCH.gap0]), zero_gap(h, f, w, c))


def make_resolve_events(
    evaluate: Callable,
    attempt: Callable,
    extend: Callable,
    project: Callable,
    method: Any,
    regimes: Callable,
    kinks: Kinks | None,
) -> Callable:
    """The kernel resolve_events(h, f, w, n, step, t_new, rows, events) -> (event?, dense output ready?, end, step)."""
    last = method.last
    evaluate_at, repeat = make_evaluate_at(evaluate, method), make_repeat(evaluate, attempt, project, method)
    follow_contacts = make_follow_contacts(evaluate, evaluate_at, extend, method, regimes)
    locate_change = make_locate_change(evaluate_at)

    @kernel
    def end_on_event(h, f, w, n, step, c):
        """Repeat the step so that it ends on the event: its length, or -1 when that fails, and whether it is there.

        Grazes are approached slowly: what is not there after three steps is left to shorter ones.
        """
        off = 0.0
        for _ in range(3):
            if not repeat(h, f, w, n, step):
                return -1.0, False
            gap, rate = w[m.TOUCH.row(h, c) + m.TOUCH.gap], w[m.TOUCH.row(h, c) + m.TOUCH.rate]
            if abs(gap) <= zero_gap(h, f, w, c):
                return step, True
            if not abs(gap) < 0.1 * abs(rate) * step:
                return step, False
            off = gap / rate
            step += off
        return step, abs(off) <= CLOSE * step

    end_on_kink = make_end_on_kink(evaluate_at, extend, repeat, kinks)
    end, accept = (kinks.end, kinks.accept) if kinks else (watch_nothing, watch_nothing)

    @kernel
    def first_change(h, f, w, n, step):
        """Contact and share of the step of its first mode change, and whether the dense output is ready."""
        ready, first, which = False, NEVER, -1
        for c in range(h[m.N_CONTACTS]):
            if not (ends_tell(h, w, n, c) or cubic_tells(h, w, n, c, step)):
                continue
            if not ready:
                extend(h, f, w, n, step)
                ready = True
            theta = locate_change(h, f, w, n, step, c)
            if theta < first:
                first, which = theta, c
        return which, first, ready

    @kernel
    def change_at_start(h, f, w, n, c, events):
        """A mode change where the step starts: no step is made."""
        n[m.IMMEDIATE] += 1
        t = w[h[m.CONTROL] + m.TIME]
        for k in range(h[m.NY]):
            w[h[m.Y_NEW] + k] = w[h[m.Y] + k]
        evaluate(h, f, w, n, t, h[m.Y_NEW], slope(h, last))
        n[m.EVALUATIONS] += 1
        if stepped_over(h, f, w, n, c):
            return give_up(n, m.STEPPED_OVER, c)
        w[m.WATCH.row(h, c) + m.WATCH.rate1] = w[m.TOUCH.row(h, c) + m.TOUCH.rate]
        change_mode(h, w, n, events, c, t)
        return give_up(n, m.STUCK_EVENT, c) if n[m.IMMEDIATE] > MOST_IMMEDIATE else RESTART

    @kernel
    def resolve_events(h, f, w, n, step, t_new, rows, events):
        t = w[h[m.CONTROL] + m.TIME]
        for shortened in range(MOST_SHORTENED + 1):
            watch_end(h, w)
            end(h, w)
            which, first, ready = first_change(h, f, w, n, step)
            length = end_on_kink(h, f, w, n, step, first if which >= 0 else 1.0, ready)
            if length < 0.0:
                return try_again(n, max(which, 0)), ready, t_new, step
            if length > 0.0:
                n[m.IMMEDIATE] = 0
                watch_end(h, w)
                end(h, w)
                accept(h, w)
                extend(h, f, w, n, length)
                return 0, follow_contacts(h, f, w, n, length, True, rows, events), t + length, length
            if which < 0:
                n[m.IMMEDIATE] = 0
                accept(h, w)
                return 0, follow_contacts(h, f, w, n, step, ready, rows, events), t_new, step
            if first * step <= 1e-15 * max(abs(t), step):
                back = backwards(h, w, n, which, w[m.WATCH.row(h, which) + m.WATCH.rate0])
                if back and resolvable(h, f, w, which, step):
                    return try_again(n, which), ready, t_new, step
                return change_at_start(h, f, w, n, which, events), True, t, step
            length, there = end_on_event(h, f, w, n, first * step, which)
            if length < 0.0:
                return try_again(n, which), ready, t_new, step
            if there or shortened == MOST_SHORTENED:
                break
            step *= min(0.5, max(SHORTER, 2.0 * first))
            t_new = t + step
            if not repeat(h, f, w, n, step):
                return try_again(n, which), ready, t_new, step
        if backwards(h, w, n, which, w[m.TOUCH.row(h, which) + m.TOUCH.rate]):
            return try_again(n, which), ready, t_new, step
        n[m.IMMEDIATE] = 0
        watch_end(h, w)
        extend(h, f, w, n, length)  # before the mode changes: the outputs of this step belong to the old one
        follow_contacts(h, f, w, n, length, True, rows, events)
        change_mode(h, w, n, events, which, t + length)
        return RESTART, True, t + length, length

    return resolve_events


def located(regimes: Callable, *families: Kinks) -> tuple[Callable, Callable, Callable]:
    """What the stepper calls at the start of a segment, the maker of what it calls after each step, and `any_closed`.

    regimes: whether contacts have regimes of sticking (`contact_phases.regimes` or `contact_phases.no_regimes`).
    families: of the kinks of friction on which steps end.
    """
    kinks = together(families)
    start_kinks = kinks.start if kinks else watch_nothing

    @kernel
    def start(h, w):
        watch_start(h, w)
        start_kinks(h, w)

    def make(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
        return make_resolve_events(evaluate, attempt, extend, project, method, regimes, kinks)

    return start, make, any_closed
