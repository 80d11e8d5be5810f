r"""Generalized-alpha: implicit structural integrator of second order that damps what it does not resolve.

.. math:: (1-\alpha_m)a_{n+1} + \alpha_m a_n = (1-\alpha_f)\dot u_{n+1} + \alpha_f\dot u_n,\quad
          q_{n+1} = q_n \circ (h u_n + h^2[(\tfrac12-\beta)a_n + \beta a_{n+1}]),\quad
          u_{n+1} = u_n + h[(1-\gamma)a_n + \gamma a_{n+1}]

with u' from the equations of motion, closures included: after index reduction no multiplier is an unknown; projection
removes the drift, as for every integrator. Rotations are composed (`retract`), not added. a belongs to the time
t_n + (alpha_m - alpha_f) h, so it is initialised there and rescaled when the step changes. First-order variables z,
which follow the speeds in the state (energy ledger, internal states of friction), obey the trapezoidal rule, coupled.

The unknowns are the *rates* at the end of the step: a, then z'. Newton's matrix has rows (1 - alpha_m) -
(1 - alpha_f) D for a and 1 - D / 2 for z', with D = gamma h d/du + beta h^2 d/dq dq'/du for columns of u, and h d/dz
for those of z. A simplified iteration uses the last Jacobian, then a new one; with fixed steps every Jacobian is new
once it converges slowly, as for friction that saturates within the step.

The error estimate compares the step with the integral of the parabola through the last three slopes; its rates are
passed through Newton's matrix, as otherwise damped modes would dictate the step.

Source: Chung & Hulbert (1993), *J. Appl. Mech.* 60, 371-375 (coefficients, eqs. 17, 20, 25); Arnold & Bruels (2007),
*Multibody Syst. Dyn.* 18, 185-202 (constrained systems); Bruels, Cardona & Arnold (2012), *Mech. Mach. Theory* 48,
121-137 (rotations).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import hermite, newton
from flexclear.dynamics.integrate.method import Method, matrix, slope, vector
from flexclear.dynamics.integrate.norms import error_scale, finite, scaled_norm, set_error_scales
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import INTEGRATORS

# rows of SLOPES: start of the step, Newton's iterate, end of the step, error estimates, search for events
ITERATE, LAST, ESTIMATE, ROWS = 1, 2, 3, 5
MOST_ITERATIONS = 30

# Memory between steps ------------------------------------------------------------------------------------------------
#: vectors of rates: accelerations at the start as stored, rates at the end, accelerations at the start for this step's
#: length, displacement, residual, row exchanges of the factors; then storage for positions, and the slope at the start
#: of the previous step
OLD, NEW, RESCALED, DISPLACEMENT, RESIDUAL, PIVOTS, SLOPE_BEFORE, VECTORS = range(8)
#: matrices: after the Jacobian Newton's matrix
NEWTON, MATRICES = 1, 2


@kernel
def n_rates(d):
    """Return the number of unknowns."""
    return d.ny - d.nq


# Coefficients and linear system --------------------------------------------------------------------------------------
def parameter(solver: Any) -> float:
    """Return the spectral radius at infinite frequency."""
    return float(solver.rho_inf)


@kernel
def coefficients(d):
    """Return alpha_m, alpha_f, beta and gamma for the spectral radius at infinity."""
    r = d.parameter
    alpha_m, alpha_f = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    return alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma


@kernel
def own_weight(d, i):
    """Return the weight of unknown i in its own equation."""
    return 1.0 - coefficients(d)[0] if i < d.nv else 1.0


@kernel
def gain(d, step, i):
    """Return the derivative of speed or variable i at the end of the step by its rate there."""
    return coefficients(d)[3] * step if i < d.nv else step


@kernel
def by_rate(d, step, i, k):
    """Return the derivative of rate i at the end of the step by rate k there, through speeds and positions."""
    row, total = matrix(d, newton.JACOBIAN) + d.ny * (d.nq + i), 0.0
    if k < d.nv:
        for q in range(d.nq):
            total += d.w[row + q] * d.w[matrix(d, newton.JACOBIAN) + d.ny * q + d.nq + k]
    return gain(d, step, k) * d.w[row + d.nq + k] + coefficients(d)[2] * step * step * total


@kernel
def factorise(d, step):
    """Factorise Newton's matrix for a step; return False when it is singular."""
    size, S = n_rates(d), matrix(d, NEWTON)
    for i in range(size):
        weight = 1.0 - coefficients(d)[1] if i < d.nv else 0.5
        for k in range(size):
            d.w[S + size * i + k] = -weight * by_rate(d, step, i, k)
        d.w[S + (size + 1) * i] += own_weight(d, i)
    d.memory[newton.FACTORED_STEP] = step
    return newton.lu_factor(d.w, S, vector(d, PIVOTS), size)


@kernel
def solve(d, b):
    """Solve Newton's system in place for the right-hand side at index b."""
    newton.lu_solve(d.w, matrix(d, NEWTON), vector(d, PIVOTS), n_rates(d), b)


@kernel
def rates_norm(d, step, a):
    """Return the norm of the state's change by the rates at index a, in units of the tolerance."""
    total, count = 0.0, n_rates(d)
    for i in range(count):
        total += (gain(d, step, i) * d.w[a + i] / error_scale(d, d.nq + i)) ** 2
    return np.sqrt(total / count)


# From step to step ---------------------------------------------------------------------------------------------------
@kernel
def predict(d, step):
    """Rescale the accelerations at the start to this step, and guess the rates at its end."""
    nq, share = d.nq, step / d.memory[newton.LAST_STEP]
    for k in range(d.nv):
        now = d.slopes[nq + k]
        a = now + share * (d.w[vector(d, OLD) + k] - now)
        d.w[vector(d, RESCALED) + k] = a
        d.w[vector(d, NEW) + k] = a + share * (now - d.w[vector(d, SLOPE_BEFORE) + nq + k])
    for k in range(d.nv, n_rates(d)):
        d.w[vector(d, NEW) + k] = d.slopes[nq + k]


@kernel
def keep(d, step):
    """Make the end of an accepted step the start of the next."""
    for k in range(d.nv):
        d.w[vector(d, OLD) + k] = d.w[vector(d, NEW) + k]
    for c in range(d.ny):
        d.w[vector(d, SLOPE_BEFORE) + c] = d.slopes[c]
    d.memory[newton.LAST_STEP] = step


@kernel
def error(d, step):
    """Return the norm of the local error, 1 at the tolerance."""
    size, start, end, before = d.ny, slope(d, 0), slope(d, ITERATE), vector(d, SLOPE_BEFORE)
    out, length = slope(d, ESTIMATE), d.memory[newton.LAST_STEP]
    for c in range(size):
        f0, f1 = d.w[start + c], d.w[end + c]
        bend = ((f1 - f0) / step - (f0 - d.w[before + c]) / length) / (step + length)
        integral = 0.5 * step * (f0 + f1) - step**3 / 6.0 * bend
        d.w[out + c] = d.y_new[c] - d.y[c] - integral
    for k in range(n_rates(d)):
        d.w[out + d.nq + k] *= own_weight(d, k)
    solve(d, out + d.nq)
    return scaled_norm(d, out)


def make_kernels(evaluate: Callable, lists: Any) -> tuple:
    """Build the method's kernels."""
    place_end, solve_step = make_newton(evaluate, lists.retract)

    @kernel
    def begin(d):
        """Initialise the accelerations at their own time, from an evaluation a little ahead along the tangent."""
        alpha_m, alpha_f, _, _ = coefficients(d)
        size, first, step = d.ny, slope(d, 0), d.step
        ahead = slope(d, ITERATE)
        for c in range(size):
            d.y_stage[c] = d.y[c] + step * d.w[first + c]
        evaluate(d, d.time + step, d.at_y_stage, ahead)
        d.evaluations += 1
        seen = d.evaluation == m.OK and finite(d, ahead)
        for c in range(size):
            change = d.w[ahead + c] - d.w[first + c] if seen else 0.0
            d.w[vector(d, SLOPE_BEFORE) + c] = d.w[first + c] - change
            if d.nq <= c < d.nq + d.nv:
                d.w[vector(d, OLD) + c - d.nq] = d.w[first + c] + (alpha_m - alpha_f) * change
        d.memory[newton.LAST_STEP] = step
        d.memory[newton.JACOBIAN_HOLDS] = 0.0
        d.evaluation = m.OK

    @kernel
    def attempt(d, step):
        """Step from Y to Y_NEW; return False when no iteration converges."""
        set_error_scales(d, d.at_y)
        if not solve_step(d, step):
            return False
        place_end(d, step, d.at_y_new)
        return True

    return begin, attempt, error, hermite.make_extend(LAST), keep


def make_newton(evaluate: Callable, retract: Callable) -> tuple[Callable, Callable]:
    """Build the kernels place_end(d, step, out) and solve_step(d, step)."""
    jacobian = newton.make_jacobian(evaluate)

    @kernel
    def place_end(d, step, out):
        """Store the state at the end of the step for the rates in NEW."""
        _, _, beta, gamma = coefficients(d)
        nq, nv, old, new, shift = d.nq, d.nv, vector(d, RESCALED), vector(d, NEW), vector(d, DISPLACEMENT)
        for k in range(nv):
            a, b, u = d.w[old + k], d.w[new + k], d.y[nq + k]
            d.w[shift + k] = step * (u + step * ((0.5 - beta) * a + beta * b))
            d.w[out + nq + k] = u + step * ((1.0 - gamma) * a + gamma * b)
        for k in range(nv, n_rates(d)):
            d.w[out + nq + k] = d.y[nq + k] + step * d.w[new + k]
        retract(d, d.at_y, shift, out)

    @kernel
    def residual(d, step):
        """Store the residual of the method's equations at the rates NEW; False when the right-hand side fails."""
        alpha_m, alpha_f, _, _ = coefficients(d)
        nq, old, start, end = d.nq, vector(d, RESCALED), slope(d, 0), slope(d, ITERATE)
        place_end(d, step, d.at_y_new)
        evaluate(d, d.time + step, d.at_y_new, end)
        d.evaluations += 1
        for i in range(n_rates(d)):
            first, last = d.w[start + nq + i], d.w[end + nq + i]
            if i < d.nv:
                due = (1.0 - alpha_f) * last + alpha_f * first - alpha_m * d.w[old + i]
            else:
                due = 0.5 * (first + last)
            d.w[vector(d, RESIDUAL) + i] = due - own_weight(d, i) * d.w[vector(d, NEW) + i]
        return d.evaluation == m.OK

    @kernel
    def iterate(d, step):
        """Iterate; return the rate at which the corrections fell, or -1 when they did not.

        With fixed steps, whose only remedy are further iterations, every Jacobian is new once convergence is slow.
        """
        left, last_norm, rate, anew = vector(d, RESIDUAL), 0.0, 0.0, False
        for k in range(MOST_ITERATIONS):
            if not residual(d, step):
                return -1.0
            if anew and not (
                jacobian(d, d.time + step, d.at_y_new, slope(d, ITERATE), slope(d, ESTIMATE)) and factorise(d, step)
            ):
                return -1.0
            solve(d, left)
            for i in range(n_rates(d)):
                d.w[vector(d, NEW) + i] += d.w[left + i]
            norm = rates_norm(d, step, left)
            rate = norm / last_norm if k > 0 else 0.0
            verdict = newton.convergence(k, norm, last_norm, d.rtol)
            if verdict > 0:
                return rate
            if verdict < 0 and (d.fixed == 0.0 or not norm <= 1e300):
                return -1.0
            anew = d.fixed > 0.0 and (anew or rate > 0.3)
            last_norm = norm
        return -1.0

    return place_end, newton.make_solve(jacobian, factorise, predict, iterate)


METHOD = Method(
    traits=INTEGRATORS["generalized-alpha"],
    room=m.Room(ROWS, hermite.ROWS, newton.FLOATS, VECTORS, MATRICES),
    last=LAST,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    error_order=2,
    steady=1.2,
    parameter=parameter,
)
