r"""Generalized-alpha: implicit structural integrator of second order that damps what it does not resolve.

.. math:: (1-\alpha_m)a_{n+1} + \alpha_m a_n = (1-\alpha_f)\dot u_{n+1} + \alpha_f\dot u_n,\quad
          q_{n+1} = q_n \circ (h u_n + h^2[(\tfrac12-\beta)a_n + \beta a_{n+1}]),\quad
          u_{n+1} = u_n + h[(1-\gamma)a_n + \gamma a_{n+1}]

with u' from the equations of motion, closures included: index reduction, so that no multiplier is an unknown; drift
is left to the projection of every integrator. Rotations are composed (`retract`), not added. a belongs to the time
t_n + (alpha_m - alpha_f) h, so it is started there and rescaled when the step changes. First-order variables (ledger,
friction's own states) follow the trapezoidal rule, coupled. The error estimate compares the step with the integral of
the parabola through the last three slopes; its speeds are passed through Newton's matrix, as otherwise damped modes
would dictate the step.

Source: Chung & Hulbert (1993), *J. Appl. Mech.* 60, 371-375 (coefficients, eqs. 17, 20, 25); Arnold & Bruels (2007),
*Multibody Syst. Dyn.* 18, 185-202 (constrained systems); Bruels, Cardona & Arnold (2012), *Mech. Mach. Theory* 48,
121-137 (rotations).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate import alpha_newton, hermite
from pipeline.dynamics.integrate.alpha_newton import ESTIMATE, ITERATE
from pipeline.dynamics.integrate.alpha_system import (
    A_STEP,
    NEW,
    OLD,
    STEP_BEFORE,
    VALID,
    before,
    constants,
    diagonal,
    memory,
    rates,
    solve,
    vector,
)
from pipeline.dynamics.integrate.method import Method
from pipeline.dynamics.integrate.stepper import finite, set_magnitudes
from pipeline.dynamics.kernels import kernel

# rows of SLOPES beside those of `alpha_newton`: where the step ends, and how many there are
LAST, ROWS = 2, 5


@kernel
def keep(h, f, w, n, step):
    """The end of an accepted step is the start of the next."""
    o = h[m.MEMORY]
    for k in range(h[m.NV]):
        w[vector(h, OLD) + k] = w[vector(h, NEW) + k]
    for c in range(h[m.NY]):
        w[before(h) + c] = w[h[m.SLOPES] + c]
    w[o + A_STEP] = w[o + STEP_BEFORE] = step


@kernel
def error(h, f, w, n, step):
    """Norm of the local error, 1 at the tolerance."""
    size, first, earlier = h[m.NY], h[m.SLOPES], before(h)
    est, length = first + size * ESTIMATE, w[h[m.MEMORY] + STEP_BEFORE]
    for c in range(size):
        f0, f1 = w[first + c], w[first + size * ITERATE + c]
        bend = ((f1 - f0) / step - (f0 - w[earlier + c]) / length) / (step + length)
        integral = 0.5 * step * (f0 + f1) - step**3 / 6.0 * bend
        w[est + c] = w[h[m.Y_NEW] + c] - w[h[m.Y] + c] - integral
    for k in range(rates(h)):
        w[est + h[m.NQ] + k] *= diagonal(h, w, k)
    solve(h, w, est + h[m.NQ])
    total = 0.0
    for c in range(size):
        total += (w[est + c] / w[h[m.MAGNITUDE] + m.GROUPS.group(h, c)]) ** 2
    return np.sqrt(total / size)


def compose(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels."""
    place, converge = alpha_newton.compose(evaluate, retract)

    @kernel
    def begin(h, f, w, n):
        """Accelerations at their own time, from a look ahead along the tangent."""
        alpha_m, alpha_f, _, _ = constants(h, w)
        o, size, first, step = h[m.MEMORY], h[m.NY], h[m.SLOPES], w[h[m.CONTROL] + m.STEP]
        ahead = first + size * ITERATE
        for c in range(size):
            w[h[m.Y_STAGE] + c] = w[h[m.Y] + c] + step * w[first + c]
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + step, h[m.Y_STAGE], ahead)
        n[m.EVALUATIONS] += 1
        seen = n[m.EVALUATION] == m.OK and finite(h, w, ahead)
        for c in range(size):
            change = w[ahead + c] - w[first + c] if seen else 0.0
            w[before(h) + c] = w[first + c] - change
            if h[m.NQ] <= c < h[m.NQ] + h[m.NV]:
                w[vector(h, OLD) + c - h[m.NQ]] = w[first + c] + (alpha_m - alpha_f) * change
        w[o + A_STEP] = w[o + STEP_BEFORE] = step
        w[o + VALID] = 0.0
        n[m.EVALUATION] = m.OK

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when no iteration converges."""
        set_magnitudes(h, f, w, h[m.Y])
        if not converge(h, f, w, n, step):
            return False
        place(h, w, step, h[m.Y_NEW])
        return True

    return begin, attempt, error, hermite.make_extend(LAST), keep


def parameter(solver: Any) -> float:
    """Spectral radius at infinite frequency."""
    return float(solver.rho_inf)


METHOD = Method(
    ROWS,
    LAST,
    hermite.ROWS,
    2,
    compose,
    hermite.interpolate,
    retracts=True,
    steady=1.2,
    memory=memory,
    parameter=parameter,
)
