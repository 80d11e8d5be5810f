"""Events between begin and end of a contact: maximum compression, peak force, sticking and slipping.

None of these changes the equations, so no step ends on them; they are located on the dense output of accepted steps, as
precisely as the integration itself. The force of a strongly damped contact peaks early in compression, so its own trend
is followed, not the penetration's. Each event stores a row of the motion, as an event that ends a step does: an impact
is shorter than most output intervals, and forces and accelerations have their extremes in it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.method import slope
from flexclear.dynamics.integrate.recording import add_event, snapshot
from flexclear.dynamics.integrate.within_step import make_locate, make_maximum
from flexclear.dynamics.kernels import kernel

#: fraction of the step over which trends at its end are measured; a force's peak nearer to the end than this is
#: the force at the end, to the square of this
BACK = 1e-3


# Contacts at the ends of a step -------------------------------------------------------------------------------
@kernel
def watch_end(d):
    """Store gaps, penetrations and their rates at the end of the step, from the last evaluation."""
    for c in range(d.n_contacts):
        watch, now = d.watch[c], d.touch[c]
        watch.gap1, watch.rate1 = now.gap, now.rate
        watch.force1, watch.slip1 = now.normal_force, now.slip


@kernel
def end_becomes_start(d):
    """Make the end of an accepted step the start of the next."""
    for c in range(d.n_contacts):
        watch = d.watch[c]
        watch.gap0, watch.rate0 = watch.gap1, watch.rate1
        watch.force0, watch.trend0 = watch.force1, watch.trend1
        watch.slip0, watch.slip_rate0 = watch.slip1, watch.slip_rate1


@kernel
def touch_at(d, c, field):
    """Return the index in w of a field of TOUCH of contact c."""
    return d.at_touch + m.TOUCH.size * c + field


# Regimes of friction -------------------------------------------------------------------------------------------------
@kernel
def no_regimes(d, c):
    """Return False: without friction a contact neither sticks nor slips."""
    return False


@kernel
def regimes(d, c):
    """Return True when the law of contact c has a sliding speed below which it sticks."""
    return d.contact_numbers[c].stick_speed > 0.0


@kernel
def may_touch_level(watch, level, step):
    """Return True when a sliding speed may cross a level and return within the step.

    The speed must approach the level at the start and leave it at the end. The tangents at both ends then meet beyond
    the level, since a speed is convex at its minimum and concave at its maximum.
    """
    first, second = watch.slip0 - level, watch.slip1 - level
    side = 1.0 if first > 0.0 else -1.0
    falls, rises = side * watch.slip_rate0 * step, side * watch.slip_rate1 * step
    if side * second <= 0.0 or falls > 0.0 or rises <= 0.0:
        return False
    meet = 0.0 if falls == 0.0 else (side * (second - first) - rises) / (falls - rises)
    return side * second - rises * (1.0 - min(max(meet, 0.0), 1.0)) < 0.0


def make_follow_contacts(
    evaluate: Callable, evaluate_at: Callable, extend: Callable, method: Any, has_regimes: Callable
) -> Callable:
    """Build the kernel follow_contacts(d, step, ready, rows, events) -> dense output ready?, for accepted steps.

    evaluate_at(d, step, theta): evaluates the dense output at a fraction of the step.
    has_regimes: `regimes` or `no_regimes`.
    """
    last, spare, interpolate = method.last, method.room.slopes - 1, method.interpolate
    maximum = make_maximum(evaluate_at)

    @kernel
    def value_at(d, step, theta, index):
        """Return w[index] after an evaluation at a fraction of the step."""
        evaluate_at(d, step, theta)
        return d.w[index]

    locate = make_locate(value_at)

    @kernel
    def measure_trends(d, step):
        """Measure the rates of each contact's force and sliding speed at the end of the step."""
        final = slope(d, last)
        for k in range(d.ny):
            d.y_stage[k] = d.y_new[k] - BACK * step * d.w[final + k]
        t = d.time + (1.0 - BACK) * step
        evaluate(d, t, d.at_y_stage, slope(d, spare))
        d.evaluations += 1
        for c in range(d.n_contacts):
            watch, before = d.watch[c], d.touch[c]
            watch.trend1 = (watch.force1 - before.normal_force) / (BACK * step)
            watch.slip_rate1 = (watch.slip1 - before.slip) / (BACK * step)

    @kernel
    def trends_matter(d):
        """Return True when a closed contact is compressing or may change between sticking and slipping."""
        matter = False
        for c in range(d.n_contacts):
            watch = d.watch[c]
            compressing = watch.rate0 > 0.0 or watch.rate1 > 0.0
            matter |= d.mode[c] == 1 and (compressing or has_regimes(d, c))
        return matter

    @kernel
    def may_peak(d, c, step, record):
        """Return True when a damped force may peak above the record within the step.

        A lossless force peaks at the largest penetration. Around its peak a force lies below its tangents.
        """
        watch = d.watch[c]
        damped = d.contact_numbers[c].damping > 0.0
        if not (damped and watch.rate0 > 0.0 and watch.trend0 > 0.0 and watch.trend1 <= 0.0):
            return False
        ahead = watch.force0 + watch.trend0 * step
        return min(ahead, watch.force1 - watch.trend1 * step) > record

    @kernel
    def may_change_regime(d, c, step):
        """Return True when contact c crosses, or may cross and recross, the speed below which it sticks."""
        if not has_regimes(d, c):
            return False
        watch, level = d.watch[c], d.contact_numbers[c].stick_speed
        passes = (watch.slip0 - level) * (watch.slip1 - level) < 0.0
        return passes or may_touch_level(watch, level, step)

    @kernel
    def record_peak(d, step, c, rows, events):
        """Record the largest force within the step when it exceeds all earlier ones of this contact."""
        event = events[int(d.watch[c].event_row)]
        peak, where = maximum(d, step, touch_at(d, c, m.TOUCH.normal_force), 1.0)
        if peak > event[m.EVENT.peak_force]:
            event[m.EVENT.peak_force] = peak
            interpolate(d, where, d.at_y_stage)
            snapshot(d, rows, d.time + where * step, d.at_y_stage)

    @kernel
    def record_compression(d, step, c, rows, events):
        """Record the event of maximum penetration."""
        watch, now = d.watch[c], d.touch[c]
        rate = touch_at(d, c, m.TOUCH.rate)
        theta = locate(d, step, rate, 0.0, 0.0, 0.0, 1.0, watch.rate0, watch.rate1)
        event = events[add_event(d, events, c, m.COMPRESSION, d.time + theta * step)]
        event[m.EVENT.speed], event[m.EVENT.peak_depth] = 0.0, -now.gap
        event[m.EVENT.peak_force] = now.normal_force
        begun = events[int(watch.event_row)]
        begun[m.EVENT.peak_depth] = max(begun[m.EVENT.peak_depth], -now.gap)
        begun[m.EVENT.peak_force] = max(begun[m.EVENT.peak_force], now.normal_force)
        snapshot(d, rows, d.time + theta * step, d.at_y_stage)

    @kernel
    def record_passage(d, step, c, a, b, fa, fb, rows, events):
        """Record the event that sticking begins or ends between the fractions a and b of the step."""
        slip = touch_at(d, c, m.TOUCH.slip)
        theta = locate(d, step, slip, d.contact_numbers[c].stick_speed, 0.0, a, b, fa, fb)
        kind = m.STICKING if fb < 0.0 else m.SLIPPING
        add_event(d, events, c, kind, d.time + theta * step)
        snapshot(d, rows, d.time + theta * step, d.at_y_stage)

    @kernel
    def record_regimes(d, step, c, rows, events):
        """Record one change between sticking and slipping, or two within the step."""
        watch, level = d.watch[c], d.contact_numbers[c].stick_speed
        first, second = watch.slip0 - level, watch.slip1 - level
        if first * second < 0.0:
            record_passage(d, step, c, 0.0, 1.0, first, second, rows, events)
            return
        sign = -1.0 if first > 0.0 else 1.0
        extreme, where = maximum(d, step, touch_at(d, c, m.TOUCH.slip), sign)
        beyond = sign * extreme - level
        if first * beyond < 0.0:
            record_passage(d, step, c, 0.0, where, first, beyond, rows, events)
            record_passage(d, step, c, where, 1.0, beyond, second, rows, events)

    @kernel
    def follow_contacts(d, step, ready, rows, events):
        if trends_matter(d):
            measure_trends(d, step)
        for c in range(d.n_contacts):
            if d.mode[c] != 1:
                continue
            watch = d.watch[c]
            event = events[int(watch.event_row)]
            largest = max(watch.force0, watch.force1)
            event[m.EVENT.peak_force] = max(event[m.EVENT.peak_force], largest)
            event[m.EVENT.peak_depth] = max(event[m.EVENT.peak_depth], -watch.gap1)
            turns = watch.rate0 > 0.0 and watch.rate1 <= 0.0
            peaks = may_peak(d, c, step, event[m.EVENT.peak_force])
            passes = may_change_regime(d, c, step)
            if (turns or peaks or passes) and not ready:
                extend(d, step)
                ready = True
            if peaks:
                record_peak(d, step, c, rows, events)
            if turns:
                record_compression(d, step, c, rows, events)
            if passes:
                record_regimes(d, step, c, rows, events)
        end_becomes_start(d)
        return ready

    return follow_contacts
