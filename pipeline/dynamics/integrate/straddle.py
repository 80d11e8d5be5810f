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

from pipeline.dynamics.assembly.places import LAST_PIVOT, PIVOT
from pipeline.dynamics.integrate.project import BLIND
from pipeline.dynamics.integrate.state import (
    BLIND_STEPS,
    EVALUATIONS,
    PASS_TIME,
    PAST_SIGMA,
    PAST_TIME,
    SIGMA,
    STEP,
    STRADDLING,
)
from pipeline.dynamics.tables import CONTROL, EVALUATION, NY, OK, SLOPES, Y_NEW, Y_STAGE, Y
from pipeline.dynamics.vectors import kernel

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
    w[h[CONTROL] + SIGMA] = np.sqrt(max(w[h[PIVOT] + LAST_PIVOT], 0.0))


@kernel
def forget(h, w, t):
    """Begin anew at time t, with no singular pose in sight."""
    c = h[CONTROL]
    w[c + PAST_SIGMA], w[c + PAST_TIME] = w[c + SIGMA], t
    w[c + PASS_TIME], w[c + STRADDLING] = NEVER, 0.0
    blind = w[c + SIGMA] > 0.0 and w[c + SIGMA] ** 2 < BLIND
    w[c + BLIND_STEPS] = w[c + BLIND_STEPS] + 1.0 if blind else 0.0


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
        c = h[CONTROL]
        sigma, past, span = w[c + SIGMA], w[c + PAST_SIGMA], t - w[c + PAST_TIME]
        straddled = w[c + STRADDLING] > 0.0
        forget(h, w, t)
        if straddled or not sigma < past:
            return
        rough = sigma * span / (past - sigma)
        if rough > CLOSELY * max(span, w[c + STEP]):
            return
        back = A_LITTLE * min(span, rough)
        for k in range(h[NY]):
            w[h[Y_STAGE] + k] = w[h[Y] + k] - back * w[h[SLOPES] + k]
        evaluate(h, f, w, n, t - back, h[Y_STAGE], h[Y_NEW])
        n[EVALUATIONS] += 1
        note(h, w)
        fall = w[c + SIGMA] - sigma
        w[c + SIGMA] = sigma
        if n[EVALUATION] == OK and fall > 0.0:
            w[c + PASS_TIME] = t + zero_ahead(sigma, fall / back, past, span)

    return foresee


@kernel
def steer(h, w, t, step, gap, stretch):
    """The next step from t: laid over a singular pose ahead with it at the share `gap`, or up to where that can be.

    stretch: how much longer than `step` it may be for that.
    """
    c = h[CONTROL]
    ahead = w[c + PASS_TIME] - t
    w[c + STRADDLING] = 0.0
    if ahead <= stretch * gap * step:
        w[c + STRADDLING] = 1.0
        return ahead / gap
    return min(step, max(ahead - MARGIN * gap * step, 0.0))


@kernel
def plan(h, w, step, following):
    """The step to try next; one that was cut short for a singular pose says little about how long it may be."""
    planned = h[CONTROL] + STEP
    least = w[planned] if step < CUT * w[planned] else 0.0
    w[planned] = max(following, least)


@kernel
def allowed(h, w):
    """Largest error norm with which the present step is accepted."""
    return BLURRED if w[h[CONTROL] + STRADDLING] > 0.0 else 1.0


@kernel
def near(h, w, t):
    """Whether a singular pose is so near that the closures must be closed to rounding."""
    return w[h[CONTROL] + PASS_TIME] - t < CLOSELY * w[h[CONTROL] + STEP]
