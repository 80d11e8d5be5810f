r"""Singular poses of the closures are foreseen, and passed in one step along a polynomial that lies ready.

In a singular pose the closure rows depend on each other, and another branch of the motion crosses. Beside it a
closure that is violated by C holds a state at :math:`C/\sigma` beside its branch, :math:`\sigma` being how independent
the rows are. So what an integrator may err grows as the pose comes near: its steps shrink like the distance, never
reach it, and at last rounding chooses the branch. What is smooth there is the motion itself, on its branch. So no
method steps near the pose: where the zero of :math:`\sigma` is ahead the stepper stops, `run.collocation` lays the
motion over the pose from states that are closed on both sides, and the stepper goes along that polynomial in one step,
whatever the method and its tolerance. Contacts are searched on it as on any dense output.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.envelope import base
from flexclear.pipeline.dynamics.equations.projection import BLIND
from flexclear.pipeline.dynamics.integrate.poses import Poses
from flexclear.pipeline.dynamics.kernels import kernel

NEVER = 1e300
#: steps ahead within which the zero of a row's independence is looked for more closely; so it is, however short the
#: steps, once a row has only this share left of the most that it had
STEPS_AHEAD, LOW = 4.0, 0.05
#: the polynomial begins, and ends, where a row has this share left of the most that it had or, where that is more, of
#: half of its own length: near enough for one polynomial, so far that rounding is blown up little
FROM, HALF = 0.3, 0.5
#: a row that has less than this share left cannot be stepped from, foreseen or not
TOO_LITTLE = 2e-4
#: steps up to there end this share of the way before it short; the time of the pose is known better from nearer
MARGIN, NEARER = 0.1, 0.7
#: share of a step over which a slope is taken: the state there comes from the slope at the end
A_LITTLE = 1e-4
#: share of the mechanism's size to which closures are closed where the polynomial ends
TIGHTLY = 1e-15


@kernel
def pivot(h, w, r):
    """How far kept row r is from depending on those before it, in the state just evaluated: a length in M^-1."""
    return 1.0 / abs(w[base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], r) + r])


@kernel
def now(h, r):
    """Where w holds the independence of row r at the end of the step."""
    return h[m.INDEPENDENCE] + r


@kernel
def past(h, r):
    """The same at its start."""
    return h[m.INDEPENDENCE] + h[m.N_CLOSURE_ROWS] + r


@kernel
def most(h, r):
    """The most that it has been at the ends of steps."""
    return h[m.INDEPENDENCE] + 2 * h[m.N_CLOSURE_ROWS] + r


@kernel
def note(h, w):
    """Remember how independent the closure rows are in the state just evaluated."""
    for r in range(h[m.N_KEPT_ROWS]):
        w[now(h, r)] = pivot(h, w, r)
    w[h[m.CONTROL] + m.SIGMA] = np.sqrt(max(w[h[m.PIVOT] + m.LAST_PIVOT], 0.0))


@kernel
def left(h, w):
    """Least share that a row has of the most that it had, in what has been noted."""
    least = 1.0
    for r in range(h[m.N_KEPT_ROWS]):
        if w[now(h, r)] < least * w[most(h, r)]:
            least = w[now(h, r)] / w[most(h, r)]
    return least


@kernel
def stand(h, w, t):
    """Take what has been noted at time t for the start of the next step."""
    for r in range(h[m.N_KEPT_ROWS]):
        w[past(h, r)] = w[now(h, r)]
        w[most(h, r)] = max(w[most(h, r)], w[now(h, r)])
    w[h[m.CONTROL] + m.PAST_TIME], w[h[m.CONTROL] + m.LEFT] = t, left(h, w)


@kernel
def zero_ahead(sigma, fall, before, span):
    """How far ahead the parabola with this value and falling slope, and with the value before, reaches zero."""
    bend = 2.0 * (before - sigma - fall * span) / (span * span)
    if bend >= 0.0:
        return sigma / fall
    return (np.sqrt(fall * fall - 2.0 * bend * sigma) - fall) / -bend


@kernel
def full(h, w, r):
    """How independent row r is away from singular poses."""
    o = h[m.ROW_SCALE] + r
    return max(w[most(h, r)], HALF * np.sqrt(max(w[o], w[o + h[m.N_CLOSURE_ROWS]])))


def make_foresee(evaluate: Callable) -> Callable:
    """The kernel foresee(h, f, w, n, t)."""

    @kernel
    def soonest(h, w, span):
        """Row that is first to depend on those before it, and when, by straight lines; -1 when that is far."""
        horizon, first, which = STEPS_AHEAD * max(span, w[h[m.CONTROL] + m.STEP]), NEVER, -1
        for r in range(h[m.N_KEPT_ROWS]):
            value, before = w[now(h, r)], w[past(h, r)]
            if value < before:
                rough = value * span / (before - value)
                if rough < first and (rough <= horizon or value <= LOW * w[most(h, r)]):
                    first, which = rough, r
        return which, first

    @kernel
    def foresee(h, f, w, n, t):
        """Time of the next singular pose, from the ends of the step that has been accepted at t.

        Roughly from both ends; when that is near, from the slope at t, by one evaluation a little earlier.
        """
        c, span = h[m.CONTROL], t - w[h[m.CONTROL] + m.PAST_TIME]
        which, rough = soonest(h, w, span)
        value, before = w[now(h, max(which, 0))], w[past(h, max(which, 0))]
        stand(h, w, t)
        blind = 0.0 < w[c + m.SIGMA] < np.sqrt(BLIND)
        w[c + m.BLIND_STEPS] = w[c + m.BLIND_STEPS] + 1.0 if blind else 0.0
        if w[c + m.PASS_TIME] < t and w[c + m.MOST_REACH] == 0.0:
            w[c + m.BLIND_STEPS] = NEVER  # a pose that no polynomial leads over has been stepped over
        w[c + m.PASS_TIME] = NEVER
        if which < 0:
            if w[c + m.LEFT] > LOW:
                w[c + m.MOST_REACH] = NEVER
            return
        back = A_LITTLE * min(span, rough)
        for k in range(h[m.NY]):
            w[h[m.Y_STAGE] + k] = w[h[m.Y] + k] - back * w[h[m.SLOPES] + k]
        evaluate(h, f, w, n, t - back, h[m.Y_STAGE], h[m.Y_NEW])
        n[m.EVALUATIONS] += 1
        fall = pivot(h, w, which) - value
        if n[m.EVALUATION] == m.OK and fall > 0.0:
            ahead = zero_ahead(value, fall / back, before, span)
            w[c + m.PASS_TIME] = t + ahead
            w[c + m.REACH] = min(w[c + m.MOST_REACH], ahead * FROM * full(h, w, which) / value)

    return foresee


@kernel
def steer(h, w, t):
    """The next step from t; 0 where a polynomial must be laid over a singular pose."""
    c = h[m.CONTROL]
    step, ahead, reach = w[c + m.STEP], w[c + m.PASS_TIME] - t, w[c + m.REACH]
    if w[c + m.MOST_REACH] > 0.0 and (ahead <= reach or w[c + m.LEFT] < TOO_LITTLE):
        return 0.0
    if ahead >= NEVER - t or w[c + m.MOST_REACH] == 0.0:
        return step
    return min(step, min(ahead - (1.0 - MARGIN) * reach, NEARER * ahead))


@kernel
def follow(h, w, share, out):
    """State at a share of the polynomial, a Chebyshev series in 2 share - 1, into w from `out`."""
    size, last, x = h[m.NY], m.COLLOCATION_ROWS - 1, 2.0 * share - 1.0
    for c in range(size):
        a = b = 0.0
        for k in range(last, 0, -1):
            a, b = w[h[m.COLLOCATION] + k * size + c] + 2.0 * x * a - b, a
        w[out + c] = w[h[m.COLLOCATION] + c] + x * a - b


@kernel
def follow_slope(h, w, share, out):
    """Its slope there: with T_k' = k U_{k-1}."""
    size, last, x = h[m.NY], m.COLLOCATION_ROWS - 1, 2.0 * share - 1.0
    length = w[h[m.CONTROL] + m.COLLOCATED]
    for c in range(size):
        a = b = 0.0
        for k in range(last, 0, -1):
            a, b = k * w[h[m.COLLOCATION] + k * size + c] + 2.0 * x * a - b, a
        w[out + c] = 2.0 / length * a


@kernel
def ready(h, w):
    """Whether the present step goes along the polynomial."""
    return w[h[m.CONTROL] + m.COLLOCATED] > 0.0


@kernel
def done(h, w, t):
    """The polynomial has been gone along, up to time t."""
    c = h[m.CONTROL]
    w[c + m.COLLOCATED] = 0.0
    if t >= w[c + m.PASS_TIME]:
        w[c + m.PASS_TIME] = w[c + m.MOST_REACH] = NEVER


def make_along(method: Any, attempt: Callable, extend: Callable) -> tuple[Callable, Callable, Callable]:
    """The method's kernels attempt, extend and interpolate, for steps along the polynomial as well."""
    interpolate, last = method.interpolate, method.last

    @kernel
    def attempt_along(h, f, w, n, step):
        if not ready(h, w):
            return attempt(h, f, w, n, step)
        share = step / w[h[m.CONTROL] + m.COLLOCATED]
        w[h[m.CONTROL] + m.FRACTION] = share
        follow(h, w, share, h[m.Y_NEW])
        follow_slope(h, w, share, h[m.SLOPES] + h[m.NY] * last)
        return True

    @kernel
    def extend_along(h, f, w, n, step):
        if not ready(h, w):
            extend(h, f, w, n, step)

    @kernel
    def interpolate_along(h, w, theta, out):
        if ready(h, w):
            follow(h, w, theta * w[h[m.CONTROL] + m.FRACTION], out)
        else:
            interpolate(h, w, theta, out)

    return attempt_along, extend_along, interpolate_along


def make_arrive(evaluate: Callable, project: Callable, attempt: Callable, method: Any) -> Callable:
    """The kernel arrive(h, f, w, n, step, t_new)."""
    last = method.last

    @kernel
    def arrive(h, f, w, n, step, t_new):
        """To the end of the polynomial, or of a share of it; closed there unless that is too near to the pose."""
        attempt(h, f, w, n, step)
        evaluate(h, f, w, n, t_new, h[m.Y_NEW], h[m.SLOPES] + h[m.NY] * last)
        n[m.EVALUATIONS] += 1
        used = -1
        if n[m.EVALUATION] == m.OK:
            tolerance = TIGHTLY * w[h[m.CONTROL] + m.LENGTH]
            used = project(h, f, w, n, t_new, h[m.Y_NEW], h[m.SLOPES] + h[m.NY] * last, tolerance)
            n[m.EVALUATIONS] += max(used, 0)
        if used >= 0:
            note(h, w)
            w[h[m.CONTROL] + m.LEFT] = left(h, w)
        else:
            attempt(h, f, w, n, step)
            n[m.EVALUATION], w[h[m.CONTROL] + m.LEFT] = m.OK, 0.0

    return arrive


OVER_POSES = Poses(note, stand, steer, ready, done, make_foresee, make_along, make_arrive)
