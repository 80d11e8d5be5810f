r"""Generalized-alpha: implicit structural integrator of second order that damps what it does not resolve.

.. math:: (1-\alpha_m)a_{n+1} + \alpha_m a_n = (1-\alpha_f)\dot u_{n+1} + \alpha_f\dot u_n,\quad
          q_{n+1} = q_n \circ (h u_n + h^2[(\tfrac12-\beta)a_n + \beta a_{n+1}]),\quad
          u_{n+1} = u_n + h[(1-\gamma)a_n + \gamma a_{n+1}]

with u' from the equations of motion, closures included: index reduction, so that no multiplier is an unknown and
Newton's matrix has the size of the speeds; drift is left to the projection of every integrator. Rotations are composed
(`displace`), not added. a belongs to the time t_n + (alpha_m - alpha_f) h, so it is started there and rescaled when
the step changes. The ledger is integrated by trapezia. The error estimate compares the step with the integral of the
parabola through the last three slopes; its speeds are passed through Newton's matrix, as otherwise damped modes would
dictate the step.

Source: Chung & Hulbert (1993), *J. Appl. Mech.* 60, 371-375 (coefficients, eqs. 17, 20, 25); Arnold & Bruels (2007),
*Multibody Syst. Dyn.* 18, 185-202 (constrained systems); Bruels, Cardona & Arnold (2012), *Mech. Mach. Theory* 48,
121-137 (rotations).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pipeline.dynamics.integrate import hermite, lu
from pipeline.dynamics.integrate.method import Method
from pipeline.dynamics.integrate.newton import converged
from pipeline.dynamics.integrate.state import EVALUATIONS, JACOBIANS, PARAMETER, RTOL, STEP, TIME
from pipeline.dynamics.integrate.stepper import finite, set_magnitudes
from pipeline.dynamics.tables import (
    CONTROL,
    EVALUATION,
    FLOORS,
    GROUPS,
    MAGNITUDE,
    MEMORY,
    NQ,
    NV,
    NY,
    OK,
    SLOPES,
    Y_NEW,
    Y_STAGE,
    Y,
)
from pipeline.dynamics.vectors import index, kernel

# rows of SLOPES: where the step starts, Newton's iterate, where it ends, error estimate, events
ITERATE, LAST, ESTIMATE, ROWS = 1, 2, 3, 5
# memory: step of the stored accelerations, step of the factors, whether the Jacobian holds, step before;
# then accelerations (old, new, old for this step's length), displacement, residual, pivots,
# scratch for positions, slope before, and three matrices: by speeds, by positions, Newton's
A_STEP, LU_STEP, VALID, STEP_BEFORE, VECTORS = range(5)
OLD, NEW, SCALED, SHIFT, RESIDUAL, PIVOTS = range(6)
MOST_ITERATIONS, SLOW = 10, 4
#: perturbation of a Jacobian's column, relative to the variable's size: root of the rounding error
NUDGE = 1e-8


def memory(nq: int, nv: int, ny: int) -> int:
    """Floats kept between steps."""
    return VECTORS + 6 * nv + nq + ny + 3 * nv * nv


@kernel
def vector(h, k):
    """Where w holds one of the vectors."""
    return h[MEMORY] + VECTORS + h[NV] * k


@kernel
def before(h):
    """Where w holds the slope before the last step."""
    return vector(h, 6) + h[NQ]


@kernel
def matrix(h, k):
    """Where w holds a matrix."""
    return before(h) + h[NY] + h[NV] * h[NV] * k


@kernel
def constants(h, w):
    """alpha_m, alpha_f, beta and gamma for the spectral radius at infinity."""
    r = w[index(h[CONTROL] + PARAMETER)]
    alpha_m, alpha_f = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    return alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma


@kernel
def keep(h, f, w, n, step):
    """The end of an accepted step is the start of the next."""
    o = h[MEMORY]
    for k in range(h[NV]):
        w[index(vector(h, OLD) + k)] = w[index(vector(h, NEW) + k)]
    for c in range(h[NY]):
        w[index(before(h) + c)] = w[index(h[SLOPES] + c)]
    w[index(o + A_STEP)] = w[index(o + STEP_BEFORE)] = step


@kernel
def factorise(h, w, step):
    """Newton's matrix for a step, factorised; False when it is singular."""
    alpha_m, alpha_f, beta, gamma = constants(h, w)
    nv, S, by_speed, by_position = h[NV], matrix(h, 2), matrix(h, 0), matrix(h, 1)
    for k in range(nv * nv):
        rate = gamma * step * w[index(by_speed + k)] + beta * step * step * w[index(by_position + k)]
        w[index(S + k)] = -(1.0 - alpha_f) * rate
    for k in range(nv):
        w[index(S + (nv + 1) * k)] += 1.0 - alpha_m
    w[index(h[MEMORY] + LU_STEP)] = step
    return lu.factor(w, S, vector(h, PIVOTS), nv)


@kernel
def error(h, f, w, n, step):
    """Norm of the local error, 1 at the tolerance."""
    alpha_m = constants(h, w)[0]
    size, first, earlier = h[NY], h[SLOPES], before(h)
    est, length = first + size * ESTIMATE, w[index(h[MEMORY] + STEP_BEFORE)]
    for c in range(size):
        f0, f1 = w[index(first + c)], w[index(first + size * ITERATE + c)]
        bend = ((f1 - f0) / step - (f0 - w[index(earlier + c)]) / length) / (step + length)
        integral = 0.5 * step * (f0 + f1) - step**3 / 6.0 * bend
        w[index(est + c)] = w[index(h[Y_NEW] + c)] - w[index(h[Y] + c)] - integral
    for k in range(h[NV]):
        w[index(est + h[NQ] + k)] *= 1.0 - alpha_m
    lu.solve(w, matrix(h, 2), vector(h, PIVOTS), h[NV], est + h[NQ])
    total = 0.0
    for c in range(size):
        total += (w[index(est + c)] / w[index(h[MAGNITUDE] + h[index(h[GROUPS] + c)])]) ** 2
    return np.sqrt(total / size)


def compose(evaluate: Callable, displace: Callable) -> tuple:
    """The method's kernels."""

    @kernel
    def begin(h, f, w, n):
        """Accelerations at their own time, from a look ahead along the tangent."""
        alpha_m, alpha_f, _, _ = constants(h, w)
        o, size, first, step = h[MEMORY], h[NY], h[SLOPES], w[index(h[CONTROL] + STEP)]
        ahead = first + size * ITERATE
        for c in range(size):
            w[index(h[Y_STAGE] + c)] = w[index(h[Y] + c)] + step * w[index(first + c)]
        evaluate(h, f, w, n, w[index(h[CONTROL] + TIME)] + step, h[Y_STAGE], ahead)
        n[EVALUATIONS] += 1
        seen = n[EVALUATION] == OK and finite(h, w, ahead)
        for c in range(size):
            change = w[index(ahead + c)] - w[index(first + c)] if seen else 0.0
            w[index(before(h) + c)] = w[index(first + c)] - change
            if h[NQ] <= c < h[NQ] + h[NV]:
                w[index(vector(h, OLD) + c - h[NQ])] = w[index(first + c)] + (alpha_m - alpha_f) * change
        w[index(o + A_STEP)] = w[index(o + STEP_BEFORE)] = step
        w[index(o + VALID)] = 0.0
        n[EVALUATION] = OK

    @kernel
    def column(h, f, w, n, k, nudge, target):
        """Column k of a Jacobian of the accelerations, from the nudged state in Y_STAGE."""
        nv, nq, near = h[NV], h[NQ], h[SLOPES] + h[NY] * ITERATE
        evaluate(h, f, w, n, w[index(h[CONTROL] + TIME)], h[Y_STAGE], near)
        n[EVALUATIONS] += 1
        for i in range(nv):
            difference = w[index(near + nq + i)] - w[index(h[SLOPES] + nq + i)]
            w[index(target + nv * i + k)] = difference / nudge
        return n[EVALUATION] == OK

    @kernel
    def jacobian(h, f, w, n):
        """Change of the accelerations with speeds and with displacements, at the start of the step."""
        nv, nq, shift = h[NV], h[NQ], vector(h, SHIFT)
        for c in range(h[NY]):
            w[index(h[Y_STAGE] + c)] = w[index(h[Y] + c)]
        for k in range(nv):
            size, speed = f[index(h[FLOORS] + h[index(h[GROUPS] + nq + k)])], w[index(h[Y] + nq + k)]
            w[index(h[Y_STAGE] + nq + k)] = speed + NUDGE * (size + abs(speed))
            if not column(h, f, w, n, k, w[index(h[Y_STAGE] + nq + k)] - speed, matrix(h, 0)):
                return False
            w[index(h[Y_STAGE] + nq + k)] = speed
            for j in range(nv):
                w[index(shift + j)] = NUDGE * size if j == k else 0.0
            displace(h, w, h[Y], shift, h[Y_STAGE], vector(h, 6))
            if not column(h, f, w, n, k, NUDGE * size, matrix(h, 1)):
                return False
            for c in range(nq):
                w[index(h[Y_STAGE] + c)] = w[index(h[Y] + c)]
        n[JACOBIANS] += 1
        w[index(h[MEMORY] + VALID)], w[index(h[MEMORY] + LU_STEP)] = 1.0, 0.0
        return True

    @kernel
    def place(h, w, step, out):
        """Positions and speeds at the end of the step for the accelerations in NEW."""
        _, _, beta, gamma = constants(h, w)
        nq, old, new, shift = h[NQ], vector(h, SCALED), vector(h, NEW), vector(h, SHIFT)
        for k in range(h[NV]):
            a, b, u = w[index(old + k)], w[index(new + k)], w[index(h[Y] + nq + k)]
            w[index(shift + k)] = step * (u + step * ((0.5 - beta) * a + beta * b))
            w[index(out + nq + k)] = u + step * ((1.0 - gamma) * a + gamma * b)
        displace(h, w, h[Y], shift, out, vector(h, 6))

    @kernel
    def iterate(h, f, w, n, step):
        """Newton's iterations; their number, or 0 when they do not converge."""
        alpha_m, alpha_f, _, gamma = constants(h, w)
        nv, nq, old, new = h[NV], h[NQ], vector(h, SCALED), vector(h, NEW)
        residual, slope = vector(h, RESIDUAL), h[SLOPES] + h[NY] * ITERATE
        last_norm = 0.0
        for k in range(MOST_ITERATIONS):
            place(h, w, step, h[Y_STAGE])
            evaluate(h, f, w, n, w[index(h[CONTROL] + TIME)] + step, h[Y_STAGE], slope)
            n[EVALUATIONS] += 1
            if n[EVALUATION] != OK:
                return 0
            for i in range(nv):
                known = alpha_f * w[index(h[SLOPES] + nq + i)] - alpha_m * w[index(old + i)]
                found = (1.0 - alpha_f) * w[index(slope + nq + i)] - (1.0 - alpha_m) * w[index(new + i)]
                w[index(residual + i)] = found + known
            lu.solve(w, matrix(h, 2), vector(h, PIVOTS), nv, residual)
            total = 0.0
            for i in range(nv):
                w[index(new + i)] += w[index(residual + i)]
                scale = w[index(h[MAGNITUDE] + h[index(h[GROUPS] + nq + i)])]
                total += (gamma * step * w[index(residual + i)] / scale) ** 2
            norm = np.sqrt(total / max(nv, 1))
            verdict = converged(k, norm, last_norm, w[index(h[CONTROL] + RTOL)])
            if verdict != 0:
                return k + 1 if verdict > 0 else 0
            last_norm = norm
        return 0

    @kernel
    def start(h, w, step):
        """Accelerations at the start for a step of this length, and a first guess of those at its end."""
        o, nq = h[MEMORY], h[NQ]
        share, on = step / w[index(o + A_STEP)], step / w[index(o + STEP_BEFORE)]
        for k in range(h[NV]):
            now = w[index(h[SLOPES] + nq + k)]
            a = now + share * (w[index(vector(h, OLD) + k)] - now)
            w[index(vector(h, SCALED) + k)] = a
            w[index(vector(h, NEW) + k)] = a + on * (now - w[index(before(h) + nq + k)])

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when Newton's iteration fails with a fresh Jacobian too."""
        o, size = h[MEMORY], h[NY]
        set_magnitudes(h, f, w, h[Y])
        for _ in range(2):
            fresh = w[index(o + VALID)] == 0.0
            if fresh and not jacobian(h, f, w, n):
                return False
            if w[index(o + LU_STEP)] != step and not factorise(h, w, step):
                return False
            start(h, w, step)
            count = iterate(h, f, w, n, step)
            if count > 0:
                w[index(o + VALID)] = 1.0 if count <= SLOW else 0.0
                place(h, w, step, h[Y_NEW])
                for c in range(h[NQ] + h[NV], size):
                    rate = w[index(h[SLOPES] + c)] + w[index(h[SLOPES] + size * ITERATE + c)]
                    w[index(h[Y_NEW] + c)] = w[index(h[Y] + c)] + 0.5 * step * rate
                return True
            w[index(o + VALID)] = 0.0
            if fresh:
                return False
        return False

    return begin, attempt, error, hermite.make_extend(LAST), keep


def parameter(solver: Any) -> float:
    """Spectral radius at infinite frequency."""
    return float(solver.rho_inf)


METHOD = Method(
    ROWS, LAST, hermite.ROWS, 2, compose, hermite.interpolate, steady=1.2, memory=memory, parameter=parameter
)
