r"""Steps over singular poses of the closures.

Let :math:`\sigma` be how independent the closure rows are; it falls to zero in a singular pose, where
another branch of the motion crosses. A closure that is violated by C holds a state at :math:`C/\sigma`
beside its branch, so that the equations of motion lead from one branch to the other, if an
integrator resolves the turn. The motion that keeps its velocity does not turn: so the singular pose
is foreseen, the closures are closed to rounding before it, and one step is laid over it in which no
stage comes near, the widest gap between the method's stages around it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.equations.projection import BLIND
from pipeline.dynamics.kernels import kernel

NEVER = 1e300
#: a step before the straddling one ends so much nearer than the straddling one needs
MARGIN = 0.9
#: share of the planned step below which a step has been cut short
CUT = 0.9
#: steps before a singular pose within which the closures are closed to rounding
CLOSELY = 4.0
#: error norm allowed over a singular pose: its stages are blurred beside the branch by rounding over sigma, which the
#: projection at the end removes; along the branch the step is as exact as those before, being no longer
BLURRED = 1e4
#: share of a step over which a slope is taken: the state there comes from the slope at the end
A_LITTLE = 1e-4


@kernel
def note(h, w):
    """Remember how independent the closure rows are in the state just evaluated."""
    w[m.CONTROL.sigma(h)] = np.sqrt(max(w[h[m.PIVOT] + m.LAST_PIVOT], 0.0))


@kernel
def forget(h, w, t):
    """Begin anew at time t, with no singular pose in sight."""
    w[m.CONTROL.past_sigma(h)], w[m.CONTROL.past_time(h)] = w[m.CONTROL.sigma(h)], t
    w[m.CONTROL.pass_time(h)], w[m.CONTROL.straddling(h)] = NEVER, 0.0
    blind = w[m.CONTROL.sigma(h)] > 0.0 and w[m.CONTROL.sigma(h)] ** 2 < BLIND
    w[m.CONTROL.blind_steps(h)] = w[m.CONTROL.blind_steps(h)] + 1.0 if blind else 0.0


@kernel
def zero_ahead(sigma, fall, past, span):
    """How far ahead the parabola with this value and falling slope, and with the past value, reaches zero."""
    bend = 2.0 * (past - sigma - fall * span) / span**2
    if bend >= 0.0:
        return sigma / fall
    return (np.sqrt(fall * fall - 2.0 * bend * sigma) - fall) / -bend


def compose(evaluate: Callable) -> Callable:
    """The kernel foresee(h, f, w, n, t)."""

    @kernel
    def foresee(h, f, w, n, t):
        """Time of the next singular pose, from the ends of the step that has been accepted at t.

        Roughly from both ends; when that is near, from the slope at t, by one evaluation a little earlier.
        """
        sigma, past, span = w[m.CONTROL.sigma(h)], w[m.CONTROL.past_sigma(h)], t - w[m.CONTROL.past_time(h)]
        straddled = w[m.CONTROL.straddling(h)] > 0.0
        forget(h, w, t)
        if straddled or not sigma < past:
            return
        rough = sigma * span / (past - sigma)
        if rough > CLOSELY * max(span, w[m.CONTROL.step(h)]):
            return
        back = A_LITTLE * min(span, rough)
        for k in range(h[m.NY]):
            w[h[m.Y_STAGE] + k] = w[h[m.Y] + k] - back * w[h[m.SLOPES] + k]
        evaluate(h, f, w, n, t - back, h[m.Y_STAGE], h[m.Y_NEW])
        n[m.EVALUATIONS] += 1
        note(h, w)
        fall = w[m.CONTROL.sigma(h)] - sigma
        w[m.CONTROL.sigma(h)] = sigma
        if n[m.EVALUATION] == m.OK and fall > 0.0:
            w[m.CONTROL.pass_time(h)] = t + zero_ahead(sigma, fall / back, past, span)

    return foresee


@kernel
def steer(h, w, t, step, gap, stretch):
    """The next step from t: laid over a singular pose ahead with it at the share `gap`, or up to where that can be.

    stretch: how much longer than `step` it may be for that.
    """
    ahead = w[m.CONTROL.pass_time(h)] - t
    w[m.CONTROL.straddling(h)] = 0.0
    if ahead <= stretch * gap * step:
        w[m.CONTROL.straddling(h)] = 1.0
        return ahead / gap
    return min(step, max(ahead - MARGIN * gap * step, 0.0))


@kernel
def plan(h, w, step, following):
    """The step to try next; one that was cut short for a singular pose says little about how long it may be."""
    planned = m.CONTROL.step(h)
    least = w[planned] if step < CUT * w[planned] else 0.0
    w[planned] = max(following, least)


@kernel
def allowed(h, w):
    """Largest error norm with which the present step is accepted."""
    return BLURRED if w[m.CONTROL.straddling(h)] > 0.0 else 1.0


@kernel
def near(h, w, t):
    """Whether a singular pose is so near that the closures must be closed to rounding."""
    return w[m.CONTROL.pass_time(h)] - t < CLOSELY * w[m.CONTROL.step(h)]
