"""What happens inside a contact between its begin and its end: maximum compression, peak force, sticking and slipping.

None of these changes the equations, so that no step ends on them; they are located on the dense
output of the steps taken, as precisely as the integration itself. The force of a strongly damped
contact peaks early in compression, so that its own trend is followed, not the penetration's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.dynamics.integrate.state import (
    COMPRESSION,
    EVALUATIONS,
    EVENT_CONTACT,
    EVENT_KIND,
    EVENT_ROW,
    EVENT_TIME,
    FORCE0,
    FORCE1,
    GAP0,
    GAP1,
    N_EVENTS,
    PEAK_DEPTH,
    PEAK_FORCE,
    RATE0,
    RATE1,
    SLIP0,
    SLIP1,
    SLIPPING,
    SPEED,
    STICKING,
    TIME,
    TREND0,
    TREND1,
    WATCH_SIZE,
)
from pipeline.dynamics.tables import (
    CONTROL,
    GAP,
    MODE,
    N_CONTACTS,
    NORMAL_FORCE,
    NORMAL_LAW,
    NY,
    RATE,
    SLIP,
    SLOPES,
    STICK_SPEED,
    WATCH,
    Y_NEW,
    Y_STAGE,
    contact_numbers,
    touch,
)
from pipeline.dynamics.vectors import kernel

#: share of the step over which the force's trend at its end is felt; a peak nearer to the end than this is
#: the force at the end, to the square of this
BACK = 1e-3
#: located to this share of the step; a maximum to its root, since it is flat
NEAR, NEAR_TOP = 1e-11, 1e-6
GOLDEN = 0.3819660112501051
MOST_LOOKS = 60


@kernel
def watch(h, c):
    """Where w holds what the stepper watches of contact c."""
    return h[WATCH] + WATCH_SIZE * c


@kernel
def remember_end(h, w):
    """Note what the contacts do at the end of the step, where it has just been evaluated."""
    for c in range(h[N_CONTACTS]):
        o, now = watch(h, c), touch(h, c)
        w[o + GAP1], w[o + RATE1] = w[now + GAP], w[now + RATE]
        w[o + FORCE1], w[o + SLIP1] = w[now + NORMAL_FORCE], w[now + SLIP]


@kernel
def no_regimes(h, f, w, c):
    """No friction: neither sticking nor slipping."""
    return False


@kernel
def regimes(h, f, w, c):
    """Whether the sliding speed passes that below which the law sticks."""
    o, level = watch(h, c), f[contact_numbers(h, c) + STICK_SPEED]
    return level > 0.0 and (w[o + SLIP0] - level) * (w[o + SLIP1] - level) < 0.0


@kernel
def note(events, n, c, kind, t):
    """A new row of the event table; returns its number."""
    row = n[N_EVENTS]
    event = events[row]
    event[EVENT_TIME], event[EVENT_CONTACT], event[EVENT_KIND] = t, c, kind
    n[N_EVENTS] = row + 1
    return row


def compose(evaluate: Callable, peek: Callable, extend: Callable, method: Any, changes_regime: Callable) -> Callable:
    """The kernel trace(h, f, w, n, step, ready, events) -> dense output ready?

    peek(h, f, w, n, step, theta): evaluates the state at a share of the step.
    """
    last, spare = method.last, method.slopes - 1

    @kernel
    def feel_trends(h, f, w, n, step):
        """Whether each force grows (> 0) at the end of the step."""
        slope = h[SLOPES] + h[NY] * last
        for k in range(h[NY]):
            w[h[Y_STAGE] + k] = w[h[Y_NEW] + k] - BACK * step * w[slope + k]
        t = w[h[CONTROL] + TIME] + (1.0 - BACK) * step
        evaluate(h, f, w, n, t, h[Y_STAGE], h[SLOPES] + h[NY] * spare)
        n[EVALUATIONS] += 1
        for c in range(h[N_CONTACTS]):
            w[watch(h, c) + TREND1] = w[watch(h, c) + FORCE1] - w[touch(h, c) + NORMAL_FORCE]

    @kernel
    def locate(h, f, w, n, step, place, level, first, second):
        """Share of the step where w[place] = level, given its distance from it at both ends (Illinois rule)."""
        a, b, fa, fb, side, theta = 0.0, 1.0, first, second, 0, 1.0
        for _ in range(MOST_LOOKS):
            before = theta
            theta = (a * fb - b * fa) / (fb - fa)
            if not a < theta < b:
                theta = 0.5 * (a + b)
            peek(h, f, w, n, step, theta)
            value = w[place] - level
            if value == 0.0 or abs(theta - before) <= NEAR:
                return theta
            if (value > 0.0) == (fb > 0.0):
                b, fb = theta, value
                fa, side = (0.5 * fa, 1) if side == 1 else (fa, 1)
            else:
                a, fa = theta, value
                fb, side = (0.5 * fb, -1) if side == -1 else (fb, -1)
        return theta

    @kernel
    def top(h, f, w, n, step, c):
        """Largest normal force within the step: parabolas through the best three, golden sections otherwise.

        Source: Brent (1973), Algorithms for Minimization without Derivatives, ch. 5.
        """
        place, a, b, d, e = touch(h, c) + NORMAL_FORCE, 0.0, 1.0, 0.0, 0.0
        x = second = third = GOLDEN
        peek(h, f, w, n, step, x)
        fx = f_second = f_third = w[place]
        for _ in range(MOST_LOOKS):
            middle = 0.5 * (a + b)
            if abs(x - middle) <= 2.0 * NEAR_TOP - 0.5 * (b - a):
                break
            r, q = (x - second) * (f_third - fx), (x - third) * (f_second - fx)
            p, q = (x - third) * q - (x - second) * r, 2.0 * (q - r)
            p, q = (-p, q) if q > 0.0 else (p, -q)
            wild = abs(p) >= abs(0.5 * q * e) or p <= q * (a - x) or p >= q * (b - x)
            if abs(e) <= NEAR_TOP or wild:
                e = b - x if x < middle else a - x
                d = GOLDEN * e
            else:
                e, d = d, p / q
            u = x + (d if abs(d) >= NEAR_TOP else (NEAR_TOP if d > 0.0 else -NEAR_TOP))
            peek(h, f, w, n, step, u)
            fu = w[place]
            if fu >= fx:
                a, b = (x, b) if u >= x else (a, x)
                third, f_third, second, f_second, x, fx = second, f_second, x, fx, u, fu
            else:
                a, b = (u, b) if u < x else (a, u)
                if fu >= f_second or second == x:
                    third, f_third, second, f_second = second, f_second, u, fu
                elif fu >= f_third or third in (x, second):
                    third, f_third = u, fu
        return fx

    @kernel
    def compression(h, f, w, n, step, c, events):
        """The deepest point of this compression, as an event."""
        o, now = watch(h, c), touch(h, c)
        theta = locate(h, f, w, n, step, now + RATE, 0.0, w[o + RATE0], w[o + RATE1])
        event = events[note(events, n, c, COMPRESSION, w[h[CONTROL] + TIME] + theta * step)]
        event[SPEED], event[PEAK_DEPTH], event[PEAK_FORCE] = 0.0, -w[now + GAP], w[now + NORMAL_FORCE]
        begun = events[int(w[o + EVENT_ROW])]
        begun[PEAK_DEPTH] = max(begun[PEAK_DEPTH], -w[now + GAP])
        begun[PEAK_FORCE] = max(begun[PEAK_FORCE], w[now + NORMAL_FORCE])

    @kernel
    def regime(h, f, w, n, step, c, events):
        """Sticking begins or ends, as an event."""
        o, level = watch(h, c), f[contact_numbers(h, c) + STICK_SPEED]
        theta = locate(h, f, w, n, step, touch(h, c) + SLIP, level, w[o + SLIP0] - level, w[o + SLIP1] - level)
        kind = STICKING if w[o + SLIP1] < level else SLIPPING
        note(events, n, c, kind, w[h[CONTROL] + TIME] + theta * step)

    @kernel
    def peaking(h, f, w, c):
        """Whether a damped force peaks within the step; a lossless one does so at the deepest point."""
        o = watch(h, c)
        damped = f[contact_numbers(h, c) + NORMAL_LAW + 2] > 0.0
        return damped and w[o + RATE0] > 0.0 and w[o + TREND0] > 0.0 and w[o + TREND1] <= 0.0

    @kernel
    def trace(h, f, w, n, step, ready, events):
        compressing = False
        for c in range(h[N_CONTACTS]):
            o = watch(h, c)
            if n[n[MODE] + c] == 1 and (w[o + RATE0] > 0.0 or w[o + RATE1] > 0.0):
                compressing = True
        if compressing:
            feel_trends(h, f, w, n, step)
        for c in range(h[N_CONTACTS]):
            if n[n[MODE] + c] != 1:
                continue
            o = watch(h, c)
            event = events[int(w[o + EVENT_ROW])]
            event[PEAK_FORCE] = max(event[PEAK_FORCE], max(w[o + FORCE0], w[o + FORCE1]))
            event[PEAK_DEPTH] = max(event[PEAK_DEPTH], -w[o + GAP1])
            turns, peaks = w[o + RATE0] > 0.0 and w[o + RATE1] <= 0.0, peaking(h, f, w, c)
            passes = changes_regime(h, f, w, c)
            if (turns or peaks or passes) and not ready:
                extend(h, f, w, n, step)
                ready = True
            if peaks:
                event[PEAK_FORCE] = max(event[PEAK_FORCE], top(h, f, w, n, step, c))
            if turns:
                compression(h, f, w, n, step, c, events)
            if passes:
                regime(h, f, w, n, step, c, events)
        for c in range(h[N_CONTACTS]):
            o = watch(h, c)
            w[o + GAP0], w[o + RATE0], w[o + FORCE0] = w[o + GAP1], w[o + RATE1], w[o + FORCE1]
            w[o + SLIP0], w[o + TREND0] = w[o + SLIP1], w[o + TREND1]
        return ready

    return trace
