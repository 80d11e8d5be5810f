"""What happens inside a contact between its begin and its end: maximum compression, peak force, sticking and slipping.

None of these changes the equations, so that no step ends on them; they are located on the dense output of the steps
taken, as precisely as the integration itself. The force of a strongly damped contact peaks early in compression, so
that its own trend is followed, not the penetration's. Each leaves a row of the motion, as an event that ends a step
does: an impact is shorter than most output intervals, and forces and accelerations have their extremes in it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate.method import slope
from flexclear.pipeline.dynamics.integrate.recording import add_event, snapshot
from flexclear.pipeline.dynamics.integrate.within_step import make_locate_level, make_maximum
from flexclear.pipeline.dynamics.kernels import kernel

#: share of the step over which trends at its end are measured; a force's peak nearer to the end than this is
#: the force at the end, to the square of this
BACK = 1e-3


# What is watched at the ends of a step -------------------------------------------------------------------------------
@kernel
def watch_end(h, w):
    """Note what the contacts do at the end of the step, where it has just been evaluated."""
    for c in range(h[m.N_CONTACTS]):
        o, now = m.WATCH.row(h, c), m.TOUCH.row(h, c)
        w[o + m.WATCH.gap1], w[o + m.WATCH.rate1] = w[now + m.TOUCH.gap], w[now + m.TOUCH.rate]
        w[o + m.WATCH.force1], w[o + m.WATCH.slip1] = w[now + m.TOUCH.normal_force], w[now + m.TOUCH.slip]


@kernel
def end_becomes_start(h, w):
    """The end of an accepted step is the start of the next."""
    for c in range(h[m.N_CONTACTS]):
        o = m.WATCH.row(h, c)
        w[o + m.WATCH.gap0], w[o + m.WATCH.rate0] = w[o + m.WATCH.gap1], w[o + m.WATCH.rate1]
        w[o + m.WATCH.force0], w[o + m.WATCH.trend0] = w[o + m.WATCH.force1], w[o + m.WATCH.trend1]
        w[o + m.WATCH.slip0], w[o + m.WATCH.slip_rate0] = w[o + m.WATCH.slip1], w[o + m.WATCH.slip_rate1]


@kernel
def record_here(h, w, n, step, theta, rows):
    """A row of the motion at a share of the step whose dense output is in Y_STAGE."""
    snapshot(h, w, n, rows, w[h[m.CONTROL] + m.TIME] + theta * step, h[m.Y_STAGE])


# Regimes of friction -------------------------------------------------------------------------------------------------
@kernel
def no_regimes(h, f, c):
    """No friction: neither sticking nor slipping."""
    return False


@kernel
def regimes(h, f, c):
    """Whether contact c has a sliding speed below which its law sticks."""
    return stick_speed(h, f, c) > 0.0


@kernel
def stick_speed(h, f, c):
    """Sliding speed below which the law of contact c sticks; 0 for laws without that."""
    return f[m.CONTACT_NUMBERS.row(h, c) + m.CONTACT_NUMBERS.stick_speed]


@kernel
def passes_level(w, o, level):
    """Whether the sliding speed passes a level between the ends of a step."""
    return (w[o + m.WATCH.slip0] - level) * (w[o + m.WATCH.slip1] - level) < 0.0


@kernel
def may_touch_level(w, o, level, step):
    """Whether a sliding speed that ends a step on the same side of a level may have been on the other meanwhile.

    It must approach the level at the start and leave it at the end; where it turns, the tangents at both ends meet
    beyond it, since a speed is convex where it passes its least value and concave at its largest.
    """
    first, second = w[o + m.WATCH.slip0] - level, w[o + m.WATCH.slip1] - level
    side = 1.0 if first > 0.0 else -1.0
    falls, rises = side * w[o + m.WATCH.slip_rate0] * step, side * w[o + m.WATCH.slip_rate1] * step
    if side * second <= 0.0 or falls > 0.0 or rises <= 0.0:
        return False
    meet = 0.0 if falls == 0.0 else (side * (second - first) - rises) / (falls - rises)
    return side * second - rises * (1.0 - min(max(meet, 0.0), 1.0)) < 0.0


def make_follow_contacts(
    evaluate: Callable, evaluate_at: Callable, extend: Callable, method: Any, has_regimes: Callable
) -> Callable:
    """The kernel follow_contacts(h, f, w, n, step, ready, rows, events) -> dense output ready?, after an accepted step.

    evaluate_at(h, f, w, n, step, theta): evaluates the dense output at a share of the step.
    has_regimes: `regimes` or `no_regimes`.
    """
    last, spare, interpolate = method.last, method.slopes - 1, method.interpolate
    locate_level, maximum = make_locate_level(evaluate_at), make_maximum(evaluate_at)

    @kernel
    def measure_trends(h, f, w, n, step):
        """At what rates each force and each sliding speed grow at the end of the step."""
        final = slope(h, last)
        for k in range(h[m.NY]):
            w[h[m.Y_STAGE] + k] = w[h[m.Y_NEW] + k] - BACK * step * w[final + k]
        t = w[h[m.CONTROL] + m.TIME] + (1.0 - BACK) * step
        evaluate(h, f, w, n, t, h[m.Y_STAGE], slope(h, spare))
        n[m.EVALUATIONS] += 1
        for c in range(h[m.N_CONTACTS]):
            o, before = m.WATCH.row(h, c), m.TOUCH.row(h, c)
            w[o + m.WATCH.trend1] = (w[o + m.WATCH.force1] - w[before + m.TOUCH.normal_force]) / (BACK * step)
            w[o + m.WATCH.slip_rate1] = (w[o + m.WATCH.slip1] - w[before + m.TOUCH.slip]) / (BACK * step)

    @kernel
    def trends_matter(h, f, w, n):
        """Whether some closed contact is compressing, or has regimes that a step may visit."""
        matter = False
        for c in range(h[m.N_CONTACTS]):
            o = m.WATCH.row(h, c)
            compressing = w[o + m.WATCH.rate0] > 0.0 or w[o + m.WATCH.rate1] > 0.0
            matter |= n[n[m.MODE] + c] == 1 and (compressing or has_regimes(h, f, c))
        return matter

    @kernel
    def may_peak(h, f, w, c, step, record):
        """Whether a damped force may peak above the record within the step; a lossless one peaks where it is deepest.

        Around its peak a force lies below its tangents.
        """
        o = m.WATCH.row(h, c)
        damped = f[m.CONTACT_NUMBERS.row(h, c) + m.CONTACT_NUMBERS.normal_law + 2] > 0.0
        if not (damped and w[o + m.WATCH.rate0] > 0.0 and w[o + m.WATCH.trend0] > 0.0 and w[o + m.WATCH.trend1] <= 0.0):
            return False
        ahead = w[o + m.WATCH.force0] + w[o + m.WATCH.trend0] * step
        return min(ahead, w[o + m.WATCH.force1] - w[o + m.WATCH.trend1] * step) > record

    @kernel
    def may_change_regime(h, f, w, c, step):
        """Whether contact c passes, or may pass and return, the speed below which it sticks."""
        if not has_regimes(h, f, c):
            return False
        o, level = m.WATCH.row(h, c), stick_speed(h, f, c)
        return passes_level(w, o, level) or may_touch_level(w, o, level, step)

    @kernel
    def record_peak(h, f, w, n, step, c, rows, events):
        """The largest force within the step, if that is a record of this contact."""
        event = events[int(w[m.WATCH.row(h, c) + m.WATCH.event_row])]
        peak, where = maximum(h, f, w, n, step, m.TOUCH.row(h, c) + m.TOUCH.normal_force, 1.0)
        if peak > event[m.EVENT.peak_force]:
            event[m.EVENT.peak_force] = peak
            interpolate(h, w, where, h[m.Y_STAGE])
            record_here(h, w, n, step, where, rows)

    @kernel
    def record_compression(h, f, w, n, step, c, rows, events):
        """The deepest point of this compression, as an event."""
        o, now = m.WATCH.row(h, c), m.TOUCH.row(h, c)
        rate, before, after = now + m.TOUCH.rate, w[o + m.WATCH.rate0], w[o + m.WATCH.rate1]
        theta = locate_level(h, f, w, n, step, rate, 0.0, 0.0, 0.0, 1.0, before, after)
        event = events[add_event(events, n, c, m.COMPRESSION, w[h[m.CONTROL] + m.TIME] + theta * step)]
        event[m.EVENT.speed], event[m.EVENT.peak_depth] = 0.0, -w[now + m.TOUCH.gap]
        event[m.EVENT.peak_force] = w[now + m.TOUCH.normal_force]
        begun = events[int(w[o + m.WATCH.event_row])]
        begun[m.EVENT.peak_depth] = max(begun[m.EVENT.peak_depth], -w[now + m.TOUCH.gap])
        begun[m.EVENT.peak_force] = max(begun[m.EVENT.peak_force], w[now + m.TOUCH.normal_force])
        record_here(h, w, n, step, theta, rows)

    @kernel
    def record_passage(h, f, w, n, step, c, a, b, fa, fb, rows, events):
        """Sticking begins or ends between the shares a and b of the step, as an event."""
        slip = m.TOUCH.row(h, c) + m.TOUCH.slip
        theta = locate_level(h, f, w, n, step, slip, stick_speed(h, f, c), 0.0, a, b, fa, fb)
        kind = m.STICKING if fb < 0.0 else m.SLIPPING
        add_event(events, n, c, kind, w[h[m.CONTROL] + m.TIME] + theta * step)
        record_here(h, w, n, step, theta, rows)

    @kernel
    def record_regimes(h, f, w, n, step, c, rows, events):
        """One passage between the regimes, or there and back, as events."""
        o, level = m.WATCH.row(h, c), stick_speed(h, f, c)
        first, second = w[o + m.WATCH.slip0] - level, w[o + m.WATCH.slip1] - level
        if first * second < 0.0:
            record_passage(h, f, w, n, step, c, 0.0, 1.0, first, second, rows, events)
            return
        sign = -1.0 if first > 0.0 else 1.0
        extreme, where = maximum(h, f, w, n, step, m.TOUCH.row(h, c) + m.TOUCH.slip, sign)
        beyond = sign * extreme - level
        if first * beyond < 0.0:
            record_passage(h, f, w, n, step, c, 0.0, where, first, beyond, rows, events)
            record_passage(h, f, w, n, step, c, where, 1.0, beyond, second, rows, events)

    @kernel
    def follow_contacts(h, f, w, n, step, ready, rows, events):
        if trends_matter(h, f, w, n):
            measure_trends(h, f, w, n, step)
        for c in range(h[m.N_CONTACTS]):
            if n[n[m.MODE] + c] != 1:
                continue
            o = m.WATCH.row(h, c)
            event = events[int(w[o + m.WATCH.event_row])]
            largest = max(w[o + m.WATCH.force0], w[o + m.WATCH.force1])
            event[m.EVENT.peak_force] = max(event[m.EVENT.peak_force], largest)
            event[m.EVENT.peak_depth] = max(event[m.EVENT.peak_depth], -w[o + m.WATCH.gap1])
            turns = w[o + m.WATCH.rate0] > 0.0 and w[o + m.WATCH.rate1] <= 0.0
            peaks = may_peak(h, f, w, c, step, event[m.EVENT.peak_force])
            passes = may_change_regime(h, f, w, c, step)
            if (turns or peaks or passes) and not ready:
                extend(h, f, w, n, step)
                ready = True
            if peaks:
                record_peak(h, f, w, n, step, c, rows, events)
            if turns:
                record_compression(h, f, w, n, step, c, rows, events)
            if passes:
                record_regimes(h, f, w, n, step, c, rows, events)
        end_becomes_start(h, w)
        return ready

    return follow_contacts
