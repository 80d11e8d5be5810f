"""Contacts begin and end at located times; the impact rate is latched there, as state.

A closing is a gap that falls through zero, an opening a penetration that does. Both are looked for in every accepted
step, also when gap and penetration return within the step; the earliest is located on the dense output, the step is
repeated to end there, and the contact's mode changes. What happens in between is followed by `contact_phases`.

The ends of a step tell gap and rate; between them a long step of free flight may hold more than one turn, so that the
cubic through them is looked at, too. Where it leaves room for a mode change, the dense output is searched from its
start on, in stretches so short that cubics describe the gap: a step of free bodies may be as long as their motion is
smooth, in which a ball travels many times its clearance and its gap, a length, turns and turns again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.contact_phases import make_follow_contacts, watch_end
from flexclear.pipeline.dynamics.integrate.friction_kinks import Kinks, make_end_on_kink, together
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.integrate.recording import add_event
from flexclear.pipeline.dynamics.integrate.stepper import AGAIN, RESTART, watch_nothing
from flexclear.pipeline.dynamics.integrate.within_step import NEAR, make_evaluate_at, make_repeat
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import at, dot, sub

#: a gap is zero below this share of the clearance plus this one, four roundings, of the mechanism's size: a difference
#: of the sites' positions has no digits below, which matters where clearances are of micrometres
ZERO_GAP, ROUNDING = 1e-12, 8.9e-16
ROOT_ITERATIONS, TURN_ITERATIONS = 60, 40
#: share of the step at which a contact changes its mode that does not
NEVER = 2.0
#: the cubic through a step's ends is trusted to this share of its own departure from a straight line; in long steps of
#: order 8 it is off by a tenth of that
TRUST = 0.2
#: where it says that something may happen, the step is searched in stretches of at most this share; they are halved
#: where the cubic through a stretch's ends misses its middle by more than this share of its departure, and of the
#: distance from which the mode change is reached (what lies behind it may be thousands of times larger), and while the
#: ball travels more than its clearance, of which the gap may tell nothing
WIDEST, FAITHFUL = 0.25, 0.05
#: to this share: even the rate of a gap jumps where a ball passes the centre of its socket
SHORTEST = 2.0**-13
#: by more than a cubic, of this departure, may be lower between the quarters of its halves
DIP = 0.05
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


# Distance to the mode change -----------------------------------------------------------------------------------------
@kernel
def side(n, c):
    """+1 for an open contact, whose gap falls to an event; -1 for a closed one, whose penetration does."""
    return 1.0 if n[n[m.MODE] + c] == 0 else -1.0


@kernel
def clearance(h, f, c):
    """Clearance of contact c."""
    return f[m.CONTACT_NUMBERS.row(h, c) + m.CONTACT_NUMBERS.clearance]


@kernel
def zero_gap(h, f, w, c):
    """Size [m] below which the gap of contact c is zero."""
    return ZERO_GAP * clearance(h, f, c) + ROUNDING * w[h[m.CONTROL] + m.LENGTH]


@kernel
def distance_between(a, b):
    """Distance of two points."""
    between = sub(a, b)
    return np.sqrt(dot(between, between))


@kernel
def cubic_middle(d0, d1, r0, r1):
    """Hermite's cubic in the middle, from its values and rates (per length of the stretch) at both ends."""
    return 0.5 * (d0 + d1) + 0.125 * (r0 - r1)


@kernel
def cubic_least(d0, d1, r0, r1):
    """The least of Hermite's cubic at the quarters."""
    first = (54.0 * d0 + 10.0 * d1 + 9.0 * r0 - 3.0 * r1) / 64.0
    last = (10.0 * d0 + 54.0 * d1 + 3.0 * r0 - 9.0 * r1) / 64.0
    return min(cubic_middle(d0, d1, r0, r1), min(first, last))


@kernel
def cubic_departure(d0, d1, r0, r1):
    """How far Hermite's cubic departs from a straight line."""
    return abs(r0 - (d1 - d0)) + abs(r1 - (d1 - d0))


@kernel
def ends_tell(h, w, n, c):
    """Whether the ends of a step show a mode change, or one turn that may hold one."""
    o, s = m.WATCH.row(h, c), side(n, c)
    return s * w[o + m.WATCH.gap1] < 0.0 or (s * w[o + m.WATCH.rate0] > 0.0 and s * w[o + m.WATCH.rate1] <= 0.0)


@kernel
def cubic_tells(h, w, n, c, step):
    """Whether the distance to the mode change may fall below zero inside the step, by the cubic through its ends."""
    o, s = m.WATCH.row(h, c), side(n, c)
    d0, d1 = s * w[o + m.WATCH.gap0], s * w[o + m.WATCH.gap1]
    r0, r1 = -s * w[o + m.WATCH.rate0] * step, -s * w[o + m.WATCH.rate1] * step
    return cubic_least(d0, d1, r0, r1) < TRUST * cubic_departure(d0, d1, r0, r1)


def make_locate_change(evaluate_at: Callable) -> Callable:
    """The kernel locate_change(h, f, w, n, step, c), after `ends_tell` or `cubic_tells`.

    It gives the share of the step where contact c changes its mode: 0 at once, NEVER not at all.
    evaluate_at(h, f, w, n, step, theta): evaluates the dense output at a share of the step.
    """

    @kernel
    def distance_at(h, f, w, n, step, theta, c):
        """Distance to the mode change (gap if open, penetration if closed) and its rate per step."""
        evaluate_at(h, f, w, n, step, theta)
        return side(n, c) * w[m.TOUCH.row(h, c) + m.TOUCH.gap], -side(n, c) * w[m.TOUCH.row(h, c) + m.TOUCH.rate] * step

    @kernel
    def turning_point(h, f, w, n, step, c, sign, low, high):
        """Share of the step where sign * distance is first least, or where it is seen to be negative at once.

        With sign -1 the distance rises from zero and is negative at the end: wherever it is seen negative, its first
        rise and fall lie before, whatever it does after.
        """
        zero, theta, last = zero_gap(h, f, w, c), low, 0
        at_low = at_high = 0.0  # rates there, zero while they are not known
        for _ in range(TURN_ITERATIONS):
            before, share = theta, 0.5
            if at_low < 0.0 < at_high:
                share = at_low / (at_low - at_high)
            theta = low + share * (high - low)
            value, rate = distance_at(h, f, w, n, step, theta, c)
            if sign * value < -zero or abs(theta - before) <= NEAR:
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
    def root(h, f, w, n, step, c, low, high):
        """Share of the step where the distance falls through zero, given > 0 at low and < 0 at high."""
        theta, enough = 0.5 * (low + high), 1e-3 * zero_gap(h, f, w, c)
        for _ in range(ROOT_ITERATIONS):
            value, rate = distance_at(h, f, w, n, step, theta, c)
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
    def change_within(h, f, w, n, step, c, low, high, start, falling, end, rising):
        """First mode change between two shares of the step with at most one turn between them, or NEVER.

        start, end: distances there; falling, rising: whether they fall at the first, and rise at the second.
        """
        zero = zero_gap(h, f, w, c)
        if end < -zero:
            if start > zero:
                return root(h, f, w, n, step, c, low, high)
            if falling:
                return low
            top = turning_point(h, f, w, n, step, c, -1.0, low, high)
            value, _ = distance_at(h, f, w, n, step, top, c)
            return root(h, f, w, n, step, c, top, high) if value > zero else low
        if falling and rising:
            bottom = turning_point(h, f, w, n, step, c, 1.0, low, high)
            value, _ = distance_at(h, f, w, n, step, bottom, c)
            if value < -zero:
                return root(h, f, w, n, step, c, low, bottom) if start > zero else low
        return NEVER

    @kernel
    def search(h, f, w, n, step, c):
        """First mode change in the step, stretch by stretch: 0 at once, NEVER not at all."""
        zero, room = zero_gap(h, f, w, c), clearance(h, f, c)
        here = m.TOUCH.row(h, c) + m.TOUCH.offset
        d0, r0 = distance_at(h, f, w, n, step, 0.0, c)
        p0 = at(w, here)
        d1, r1 = distance_at(h, f, w, n, step, WIDEST, c)
        p1 = at(w, here)
        low, high = 0.0, WIDEST
        while True:
            width, middle = high - low, 0.5 * (low + high)
            d, r = distance_at(h, f, w, n, step, middle, c)
            p = at(w, here)
            half, missed = 0.5 * width, abs(d - cubic_middle(d0, d1, width * r0, width * r1))
            least = min(cubic_least(d0, d, half * r0, half * r), cubic_least(d, d1, half * r, half * r1))
            bend = cubic_departure(d0, d1, width * r0, width * r1)
            if not min(least, min(d, d1)) > missed + DIP * bend:
                near = FAITHFUL * min(bend, max(d0, max(d, d1))) + zero
                known = missed <= near and distance_between(p0, p) + distance_between(p, p1) <= room
                if width > SHORTEST and not known:
                    high, d1, r1, p1 = middle, d, r, p
                    continue
                theta = change_within(h, f, w, n, step, c, low, middle, d0, r0 < 0.0, d, r >= 0.0)
                if theta == NEVER:
                    theta = change_within(h, f, w, n, step, c, middle, high, d, r < 0.0, d1, r1 >= 0.0)
                if theta != NEVER:
                    return theta
            if high >= 1.0:
                return NEVER
            low, d0, r0, p0 = high, d1, r1, p1
            high = min(low + min(2.0 * width, WIDEST), 1.0)
            d1, r1 = distance_at(h, f, w, n, step, high, c)
            p1 = at(w, here)

    @kernel
    def locate_change(h, f, w, n, step, c):
        if cubic_tells(h, w, n, c, step):
            return search(h, f, w, n, step, c)
        o, s = m.WATCH.row(h, c), side(n, c)
        start, falling = s * w[o + m.WATCH.gap0], s * w[o + m.WATCH.rate0] > 0.0
        end, rising = s * w[o + m.WATCH.gap1], s * w[o + m.WATCH.rate1] <= 0.0
        return change_within(h, f, w, n, step, c, 0.0, 1.0, start, falling, end, rising)

    return locate_change


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
