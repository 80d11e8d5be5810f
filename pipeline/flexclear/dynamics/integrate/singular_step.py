r"""Singular poses of the closures: prediction, and passage in one step along a prepared polynomial.

In a singular pose the closure rows are linearly dependent, and another branch of the motion crosses. Near it, with
:math:`\sigma` the independence of the rows, a closure residual C displaces the state by :math:`C/\sigma` from its
branch. So errors of an integrator grow as the pose approaches: its steps shrink like the distance, never reach the
pose, and at last rounding chooses the branch. The motion itself is smooth on its branch. So no method steps near the
pose. When a zero of :math:`\sigma` is ahead, the stepper stops, `run.singular_poses.collocation` fits a polynomial over
the pose to states with closed loops on both sides, and the stepper follows that polynomial in one step, whatever the
method and its tolerance. Contacts are searched on it as on any dense output.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.projection import BLIND
from flexclear.dynamics.kernels import kernel

NEVER = 1e300
#: number of steps ahead within which the zero of a row's independence is predicted more closely; below the second
#: number, a row's independence over its largest so far, it is whatever the length of the steps
STEPS_AHEAD, LOW = 4.0, 0.05
#: the polynomial begins, and ends, where a row's independence is this fraction of its largest so far or, if that is
#: more, of half of its own length: near enough for one polynomial, far enough for little amplification of rounding
FROM, HALF = 0.3, 0.5
#: no step starts where a row's independence is less than this fraction of its largest so far
TOO_LITTLE = 2e-4


@kernel
def pivot(d, r):
    """Return the independence of selected row r from the rows before it, after an evaluation: a length in M^-1."""
    return 1.0 / abs(d.roots[r])


@kernel
def note(d):
    """Store the independence of the closure rows in the state evaluated last."""
    for r in range(d.n_kept_rows):
        d.independence[r].now = pivot(d, r)
    d.sigma = np.sqrt(max(d.last_pivot, 0.0))


@kernel
def least_independence(d):
    """Return the least ratio of a row's stored independence to its largest so far."""
    least = 1.0
    for r in range(d.n_kept_rows):
        row = d.independence[r]
        if row.now < least * row.most:
            least = row.now / row.most
    return least


@kernel
def keep_independence(d, t):
    """Make the independence stored at time t that of the next step's start."""
    for r in range(d.n_kept_rows):
        row = d.independence[r]
        row.past, row.most = row.now, max(row.most, row.now)
    d.past_time, d.left = t, least_independence(d)


@kernel
def zero_ahead(sigma, fall, before, span):
    """Return the time to the zero of the parabola with this value and falling slope, and with the value before."""
    bend = 2.0 * (before - sigma - fall * span) / (span * span)
    if bend >= 0.0:
        return sigma / fall
    return (np.sqrt(fall * fall - 2.0 * bend * sigma) - fall) / -bend


@kernel
def full(d, r):
    """Return the independence of row r far from singular poses."""
    o = d.at_row_scale + r
    return max(d.independence[r].most, HALF * np.sqrt(max(d.w[o], d.w[o + d.n_closure_rows])))


def make_foresee(evaluate: Callable) -> Callable:
    """Build the kernel foresee(d, t)."""

    @kernel
    def soonest(d, span):
        """Return the row that becomes dependent first, and when, by linear extrapolation; -1 when none does soon."""
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
        """Return the time of the next singular pose, predicted from the step that was accepted at t.

        The ends of the step give a rough time; if that is soon, an evaluation shortly before t gives the slope there.
        """
        span = t - d.past_time
        which, rough = soonest(d, span)
        value, before = (
            d.independence[max(which, 0)].now,
            d.independence[max(which, 0)].past,
        )  # `keep_independence` moves them
        keep_independence(d, t)
        blind = 0.0 < d.sigma < np.sqrt(BLIND)
        d.blind_steps = d.blind_steps + 1.0 if blind else 0.0
        if d.pass_time < t and d.most_reach == 0.0:
            d.blind_steps = NEVER  # a pose that no polynomial leads over has been stepped over
        d.pass_time = NEVER
        if which < 0:
            if d.left > LOW:
                d.most_reach = NEVER
            return
        # fraction of a step for the finite difference of the slope: the state there comes from the slope at the end
        back = 1e-4 * min(span, rough)
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
    """Return the next step from t; 0 when a polynomial over a singular pose is needed first."""
    step, ahead, reach = d.step, d.pass_time - t, d.reach
    if d.most_reach > 0.0 and (ahead <= reach or d.left < TOO_LITTLE):
        return 0.0
    if ahead >= NEVER - t or d.most_reach == 0.0:
        return step
    # steps towards that point end short of it by this fraction of the way: nearer, the time of the pose is known better
    return min(step, min(ahead - 0.9 * reach, 0.7 * ahead))


@kernel
def follow(d, share, out):
    """Store the state at a fraction of the polynomial, a Chebyshev series in 2 share - 1, in w from `out`."""
    size, last, x = d.ny, m.COLLOCATION_ROWS - 1, 2.0 * share - 1.0
    for c in range(size):
        a = b = 0.0
        for k in range(last, 0, -1):
            a, b = d.collocation[k * size + c] + 2.0 * x * a - b, a
        d.w[out + c] = d.collocation[c] + x * a - b


@kernel
def follow_slope(d, share, out):
    """Store the polynomial's slope at a fraction of it, with T_k' = k U_{k-1}."""
    size, last, x = d.ny, m.COLLOCATION_ROWS - 1, 2.0 * share - 1.0
    length = d.collocated
    for c in range(size):
        a = b = 0.0
        for k in range(last, 0, -1):
            a, b = k * d.collocation[k * size + c] + 2.0 * x * a - b, a
        d.w[out + c] = 2.0 / length * a


@kernel
def ready(d):
    """Return True when the present step follows the polynomial."""
    return d.collocated > 0.0


@kernel
def done(d, t):
    """Discard the polynomial, which the motion has followed up to time t."""
    d.collocated = 0.0
    if t >= d.pass_time:
        d.pass_time = d.most_reach = NEVER


def make_along(method: Any, attempt: Callable, extend: Callable) -> tuple[Callable, Callable, Callable]:
    """Return the method's kernels attempt, extend and interpolate, extended to steps along the polynomial."""
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
    """Build the kernel arrive(d, step, t_new)."""
    last = method.last

    @kernel
    def arrive(d, step, t_new):
        """Step to the end of the polynomial, or of a fraction of it; close the loops unless the pose is too near."""
        attempt(d, step)
        evaluate(d, t_new, d.at_y_new, d.at_slopes + d.ny * last)
        d.evaluations += 1
        used = -1
        if d.evaluation == m.OK:
            # fraction of the mechanism's size to which closures are closed where the polynomial ends
            tolerance = 1e-15 * d.length
            used = project(d.h, d.f, d.w, d.n, t_new, d.at_y_new, d.at_slopes + d.ny * last, tolerance)
            d.evaluations += max(used, 0)
        if used >= 0:
            note(d)
            d.left = least_independence(d)
        else:
            attempt(d, step)
            d.evaluation, d.left = m.OK, 0.0

    return arrive
