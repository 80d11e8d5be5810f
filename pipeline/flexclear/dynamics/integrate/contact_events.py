"""Contacts begin and end at located times; the impact rate is latched there, as state.

A closing is a gap that falls through zero, an opening a penetration that does. Every accepted
step is searched for both, also when gap and penetration return within the step. The earliest one is located on the
dense output (`mode_changes`), the step is repeated to end there, and the contact's mode changes. `contact_phases`
records what happens during contact.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import mode_changes
from flexclear.dynamics.integrate.contact_phases import make_follow_contacts, watch_end
from flexclear.dynamics.integrate.method import slope
from flexclear.dynamics.integrate.recording import add_event
from flexclear.dynamics.integrate.stepper import AGAIN, NO_GUARDS, RESTART
from flexclear.dynamics.integrate.within_step import make_evaluate_at, make_repeat
from flexclear.dynamics.kernels import kernel

#: the dense output of a long step misplaces what a contact does in a small fraction of it; the step is then repeated,
#: at most so often, with this fraction of its length or more
MOST_SHORTENED, REPEATED_FRACTION = 8, 0.1
#: a contact that begins deeper than this fraction of its clearance, and so many tolerances, has been stepped over
DEPTH_STEPPED_OVER, ERRORS = 1e-6, 100.0


# Modes ---------------------------------------------------------------------------------------------------------------
@kernel
def watch_start(d):
    """Store gaps, penetrations and their rates at the start of a segment, from the last evaluation."""
    for c in range(d.n_contacts):
        watch, now = d.watch[c], d.touch[c]
        watch.gap0, watch.rate0 = now.gap, now.rate
        watch.force0, watch.slip0 = now.normal_force, now.slip
        watch.slip_rate0 = 0.0


@kernel
def any_closed(d):
    """Return True when a contact is closed."""
    result = False
    for c in range(d.n_contacts):
        result |= d.mode[c] == 1
    return result


@kernel
def relax_bristles(d, c):
    """Set the bristle states of a beginning contact to zero."""
    place = d.contacts[c].bristle
    if place >= 0:
        for k in range(3):
            d.y_new[place + k] = 0.0


@kernel
def change_mode(d, events, c, t):
    """Change the mode of contact c at time t, latch its impact rate, and record the event."""
    watch = d.watch[c]
    rate = watch.rate1
    if d.mode[c] == 0:
        d.mode[c] = 1
        d.latched[c] = max(rate, 0.0)
        relax_bristles(d, c)
        row = add_event(d, events, c, m.CLOSING, t)
        event = events[row]
        event[m.EVENT.speed], event[m.EVENT.peak_force], event[m.EVENT.peak_depth] = rate, 0.0, 0.0
        watch.event_row, watch.trend0 = row, m.STEEPLY
    else:
        d.mode[c] = 0
        ended = events[add_event(d, events, c, m.OPENING, t)]
        ended[m.EVENT.speed] = -rate
        begun = events[int(watch.event_row)]
        begun[m.EVENT.duration] = t - begun[m.EVENT.time]


# Events of a step ----------------------------------------------------------------------------------------------------
@kernel
def give_up(d, status, c):
    """Return the result of resolve_events for a contact c that ends the run."""
    d.status, d.culprit = status, c
    return -1


@kernel
def try_again(d, c):
    """Return the result of resolve_events for a step that cannot end on an event of contact c."""
    give_up(d, m.LOST_CLOSURE, c)
    return AGAIN


@kernel
def stepped_over(d, c):
    """Return True when contact c, which changes its mode at the start of a step, is already too deep for a begin."""
    gap, length = d.touch[c].gap, d.contact_numbers[c].length
    deep = DEPTH_STEPPED_OVER * d.contact_numbers[c].clearance + ERRORS * d.rtol * length
    return gap < -deep and d.mode[c] == 0


@kernel
def backwards(d, c, rate):
    """Return True when contact c would change its mode on its way back: a graze that a shorter step must resolve.

    Fixed steps and polynomials cannot be shortened.
    """
    return mode_changes.side(d, c) * rate < 0.0 and d.fixed == 0.0 and d.collocated == 0.0


@kernel
def resolvable(d, c, step):
    """Return True when contact c moves further in a step than the uncertainty of its gap at the start."""
    watch = d.watch[c]
    # a contact that would end where it has just begun is resolved by shorter steps, down to one in which it moves by so
    # many times the error of its gap
    return abs(watch.rate0) * step > 10.0 * max(abs(watch.gap0), mode_changes.zero_gap(d, c))


def make_resolve_events(
    evaluate: Callable,
    attempt: Callable,
    extend: Callable,
    project: Callable,
    method: Any,
    regimes: Callable,
    guards: tuple[Callable, ...],
) -> Callable:
    """Build the kernel resolve_events(d, step, t_new, rows, events) -> (event?, dense output ready?, end, step)."""
    last = method.last
    evaluate_at, repeat = make_evaluate_at(evaluate, method), make_repeat(evaluate, attempt, project, method)
    follow_contacts = make_follow_contacts(evaluate, evaluate_at, extend, method, regimes)
    locate_change = mode_changes.make_locate_change(evaluate_at)

    @kernel
    def end_on_event(d, step, c):
        """Repeat the step to end on the event; return its length (-1: it fails), and whether its end is on the event.

        Newton's iteration approaches grazes slowly: after three repetitions shorter steps take over.
        """
        off = 0.0
        for _ in range(3):
            if not repeat(d, step):
                return -1.0, False
            gap, rate = d.touch[c].gap, d.touch[c].rate
            if abs(gap) <= mode_changes.zero_gap(d, c):
                return step, True
            if not abs(gap) < 0.1 * abs(rate) * step:
                return step, False
            off = gap / rate
            step += off
        # fraction of its length by which a step may miss the event on which it must end
        return step, abs(off) <= 1e-6 * step

    _, note_end, accept, make_end_on_guard = guards
    end_on_guard = make_end_on_guard(evaluate_at, extend, repeat)

    @kernel
    def first_change(d, step):
        """Return contact and fraction of the step of the first mode change, and whether the dense output is ready."""
        ready, first, which = False, mode_changes.NO_CHANGE, -1
        for c in range(d.n_contacts):
            if not (mode_changes.ends_tell(d, c) or mode_changes.cubic_tells(d, c, step)):
                continue
            if not ready:
                extend(d, step)
                ready = True
            theta = locate_change(d, step, c)
            if theta < first:
                first, which = theta, c
        return which, first, ready

    @kernel
    def change_at_start(d, c, events):
        """Change the mode of contact c at the start of the step; no step is made."""
        d.immediate += 1
        t = d.time
        for k in range(d.ny):
            d.y_new[k] = d.y[k]
        evaluate(d, t, d.at_y_new, slope(d, last))
        d.evaluations += 1
        if stepped_over(d, c):
            return give_up(d, m.STEPPED_OVER, c)
        d.watch[c].rate1 = d.touch[c].rate
        change_mode(d, events, c, t)
        # mode changes at one and the same time before the solver gives up (Zeno)
        return give_up(d, m.STUCK_EVENT, c) if d.immediate > 200 else RESTART

    @kernel
    def resolve_events(d, step, t_new, rows, events):
        t = d.time
        for shortened in range(MOST_SHORTENED + 1):
            watch_end(d)
            note_end(d)
            which, first, ready = first_change(d, step)
            length = end_on_guard(d, step, first if which >= 0 else 1.0, ready)
            if length < 0.0:
                return try_again(d, max(which, 0)), ready, t_new, step
            if length > 0.0:
                d.immediate = 0
                watch_end(d)
                note_end(d)
                accept(d)
                extend(d, length)
                return 0, follow_contacts(d, length, True, rows, events), t + length, length
            if which < 0:
                d.immediate = 0
                accept(d)
                return 0, follow_contacts(d, step, ready, rows, events), t_new, step
            if first * step <= 1e-15 * max(abs(t), step):
                back = backwards(d, which, d.watch[which].rate0)
                if back and resolvable(d, which, step):
                    return try_again(d, which), ready, t_new, step
                return change_at_start(d, which, events), True, t, step
            length, there = end_on_event(d, first * step, which)
            if length < 0.0:
                return try_again(d, which), ready, t_new, step
            if there or shortened == MOST_SHORTENED:
                break
            step *= min(0.5, max(REPEATED_FRACTION, 2.0 * first))
            t_new = t + step
            if not repeat(d, step):
                return try_again(d, which), ready, t_new, step
        if backwards(d, which, d.touch[which].rate):
            return try_again(d, which), ready, t_new, step
        d.immediate = 0
        watch_end(d)
        extend(d, length)  # before the mode changes: the outputs of this step belong to the old one
        follow_contacts(d, length, True, rows, events)
        change_mode(d, events, which, t + length)
        return RESTART, True, t + length, length

    return resolve_events


def located(regimes: Callable, guards: tuple[Callable, ...] = NO_GUARDS) -> tuple[Callable, Callable, Callable]:
    """Return the stepper's kernel for segment starts, the maker of its kernel for step ends, and `any_closed`.

    regimes: whether contacts have regimes of sticking (`contact_phases.regimes` or `contact_phases.no_regimes`).
    guards: levels on which steps end as well (`guards.AMONG_CONTACTS`).
    """
    note_start = guards[0]

    @kernel
    def start(d):
        watch_start(d)
        note_start(d)

    def make(evaluate: Callable, attempt: Callable, extend: Callable, project: Callable, method: Any) -> Callable:
        return make_resolve_events(evaluate, attempt, extend, project, method, regimes, guards)

    return start, make, any_closed
