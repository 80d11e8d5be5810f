r"""Singular poses of the closures are foreseen, and passed in one step along a polynomial that lies ready.

In a singular pose the closure rows depend on each other, and another branch of the motion crosses. Next to it a closure
that is violated by C holds a state at :math:`C/\sigma` from its branch, :math:`\sigma` being how independent the rows
are. So what an integrator may err grows as the pose comes near: its steps shrink like the distance, never reach it, and
at last rounding chooses the branch. What is smooth there is the motion itself, on its branch. So no method steps near
the pose: where the zero of :math:`\sigma` is ahead the stepper stops, `run.singular_poses.collocation` lays the motion
over the pose from states that are closed on both sides, and the stepper goes along that polynomial in one step,
whatever the method and its tolerance. Contacts are searched on it as on any dense output.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.envelope import base
from flexclear.pipeline.dynamics.equations.projection import BLIND
from flexclear.pipeline.dynamics.kernels import kernel

NEVER = 1e300
#: steps ahead within which the zero of a row's independence is looked for more closely; so it is, however short the
#: steps, once a row has only this fraction left of the most that it had
STEPS_AHEAD, LOW = 4.0, 0.05
#: the polynomial begins, and ends, where a row has this fraction left of the most that it had or, where that is more,
#: of half of its own length: near enough for one polynomial, so far that rounding is blown up little
FROM, HALF = 0.3, 0.5
#: a row that has less than this fraction left cannot be stepped from, predicted or not
TOO_LITTLE = 2e-4
#: steps up to there end this fraction of the way before it short; the time of the pose is known better from nearer
POSE_MARGIN, NEARER = 0.1, 0.7
#: fraction of a step over which a slope is taken: the state there comes from the slope at the end
SLOPE_FRACTION = 1e-4
#: fraction of the mechanism's size to which closures are closed where the polynomial ends
TIGHTLY = 1e-15


@kernel
def pivot(d, r):
    """How far kept row r is from depending on those before it, in the state just evaluated: a length in M^-1."""
    return 1.0 / abs(d.w[base(d.h, d.at_closure_envelope, d.at_schur, r) + r])


@kernel
def note(d):
    """Remember how independent the closure rows are in the state just evaluated."""
    for r in range(d.n_kept_rows):
        d.independence[r].now = pivot(d, r)
    d.sigma = np.sqrt(max(d.last_pivot, 0.0))


@kernel
def left(d):
    """Least fraction that a row has of the most that it had, in what has been noted."""
    least = 1.0
    for r in range(d.n_kept_rows):
        row = d.independence[r]
        if row.now < least * row.most:
            least = row.now / row.most
    return least


@kernel
def stand(d, t):
    """Take what has been noted at time t for the start of the next step."""
    for r in range(d.n_kept_rows):
        row = d.independence[r]
        row.past, row.most = row.now, max(row.most, row.now)
    d.past_time, d.left = t, left(d)


@kernel
def zero_ahead(sigma, fall, before, span):
    """How far ahead the parabola with this value and falling slope, and with the value before, reaches zero."""
    bend = 2.0 * (before - sigma - fall * span) / (span * span)
    if bend >= 0.0:
        return sigma / fall
    return (np.sqrt(fall * fall - 2.0 * bend * sigma) - fall) / -bend


@kernel
def full(d, r):
    """How independent row r is away from singular poses."""
    o = d.at_row_scale + r
    return max(d.independence[r].most, HALF * np.sqrt(max(d.w[o], d.w[o + d.n_closure_rows])))


def make_foresee(evaluate: Callable) -> Callable:
    """The kernel foresee(d, t)."""

    @kernel
    def soonest(d, span):
        """Row that is first to depend on those before it, and when, by straight lines; -1 when that is far."""
        horizon, first, which = STEPS_AHEAD * max(span, d.step), NEVER, -1
        for r in range(d.n_kept_rows):
            row = d.independence[r]
            if row.now < row.past:
                rough = row.now * span / (row.past - row.now)
                if rough < first and (rough <= horizon or row.now <= LOW * row.most):
                    first, which = rough, r
        return which, first

    @kernel
    def foresee(d, t):
        """Time of the next singular pose, from the ends of the step that has been accepted at t.

        Roughly from both ends; when that is near, from the slope at t, by one evaluation a little earlier.
        """
        span = t - d.past_time
        which, rough = soonest(d, span)
        value, before = d.independence[max(which, 0)].now, d.independence[max(which, 0)].past  # `stand` moves them
        stand(d, t)
        blind = 0.0 < d.sigma < np.sqrt(BLIND)
        d.blind_steps = d.blind_steps + 1.0 if blind else 0.0
        if d.pass_time < t and d.most_reach == 0.0:
            d.blind_steps = NEVER  # a pose that no polynomial leads over has been stepped over
        d.pass_time = NEVER
        if which < 0:
            if d.left > LOW:
                d.most_reach = NEVER
            return
        back = SLOPE_FRACTION * min(span, rough)
        for k in range(d.ny):
            d.y_stage[k] = d.y[k] - back * d.slopes[k]
        evaluate(d, t - back, d.at_y_stage, d.at_y_new)
        d.evaluations += 1
        fall = pivot(d, which) - value
        if d.evaluation == m.OK and fall > 0.0:
            ahead = zero_ahead(value, fall / back, before, span)
            d.pass_time = t + ahead
            d.reach = min(d.most_reach, ahead * FROM * full(d, which) / value)

    return foresee


@kernel
def steer(d, t):
    """The next step from t; 0 where a polynomial must be laid over a singular pose."""
    step, ahead, reach = d.step, d.pass_time - t, d.reach
    if d.most_reach > 0.0 and (ahead <= reach or d.left < TOO_LITTLE):
        return 0.0
    if ahead >= NEVER - t or d.most_reach == 0.0:
        return step
    return min(step, min(ahead - (1.0 - POSE_MARGIN) * reach, NEARER * ahead))


@kernel
def follow(d, share, out):
    """State at a fraction of the polynomial, a Chebyshev series in 2 share - 1, into w from `out`."""
    size, last, x = d.ny, m.COLLOCATION_ROWS - 1, 2.0 * share - 1.0
    for c in range(size):
        a = b = 0.0
        for k in range(last, 0, -1):
            a, b = d.collocation[k * size + c] + 2.0 * x * a - b, a
        d.w[out + c] = d.collocation[c] + x * a - b


@kernel
def follow_slope(d, share, out):
    """Its slope there: with T_k' = k U_{k-1}."""
    size, last, x = d.ny, m.COLLOCATION_ROWS - 1, 2.0 * share - 1.0
    length = d.collocated
    for c in range(size):
        a = b = 0.0
        for k in range(last, 0, -1):
            a, b = k * d.collocation[k * size + c] + 2.0 * x * a - b, a
        d.w[out + c] = 2.0 / length * a


@kernel
def ready(d):
    """Whether the present step goes along the polynomial."""
    return d.collocated > 0.0


@kernel
def done(d, t):
    """The polynomial has been gone along, up to time t."""
    d.collocated = 0.0
    if t >= d.pass_time:
        d.pass_time = d.most_reach = NEVER


def make_along(method: Any, attempt: Callable, extend: Callable) -> tuple[Callable, Callable, Callable]:
    """The method's kernels attempt, extend and interpolate, for steps along the polynomial as well."""
    interpolate, last = method.interpolate, method.last

    @kernel
    def attempt_along(d, step):
        if not ready(d):
            return attempt(d, step)
        share = step / d.collocated
        d.fraction = share
        follow(d, share, d.at_y_new)
        follow_slope(d, share, d.at_slopes + d.ny * last)
        return True

    @kernel
    def extend_along(d, step):
        if not ready(d):
            extend(d, step)

    @kernel
    def interpolate_along(d, theta, out):
        if ready(d):
            follow(d, theta * d.fraction, out)
        else:
            interpolate(d, theta, out)

    return attempt_along, extend_along, interpolate_along


def make_arrive(evaluate: Callable, project: Callable, attempt: Callable, method: Any) -> Callable:
    """The kernel arrive(d, step, t_new)."""
    last = method.last

    @kernel
    def arrive(d, step, t_new):
        """To the end of the polynomial, or of a fraction of it; closed there unless that is too near to the pose."""
        attempt(d, step)
        evaluate(d, t_new, d.at_y_new, d.at_slopes + d.ny * last)
        d.evaluations += 1
        used = -1
        if d.evaluation == m.OK:
            tolerance = TIGHTLY * d.length
            used = project(d.h, d.f, d.w, d.n, t_new, d.at_y_new, d.at_slopes + d.ny * last, tolerance)
            d.evaluations += max(used, 0)
        if used >= 0:
            note(d)
            d.left = left(d)
        else:
            attempt(d, step)
            d.evaluation, d.left = m.OK, 0.0

    return arrive
