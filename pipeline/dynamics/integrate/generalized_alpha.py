r"""Generalized-alpha: implicit structural integrator of second order that damps what it does not resolve.

.. math:: (1-\alpha_m)a_{n+1} + \alpha_m a_n = (1-\alpha_f)\dot u_{n+1} + \alpha_f\dot u_n,\quad
          q_{n+1} = q_n \circ (h u_n + h^2[(\tfrac12-\beta)a_n + \beta a_{n+1}]),\quad
          u_{n+1} = u_n + h[(1-\gamma)a_n + \gamma a_{n+1}]

with u' from the equations of motion, closures included: index reduction, so that no multiplier is an unknown; drift
is left to the projection of every integrator. Rotations are composed (`retract`), not added. a belongs to the time
t_n + (alpha_m - alpha_f) h, so it is started there and rescaled when the step changes. First-order variables z, which
follow the speeds in the state (ledger, friction's own states), follow the trapezoidal rule, coupled.

The unknowns are the *rates* at the end of the step: a, then z'. Newton's matrix has rows (1 - alpha_m) -
(1 - alpha_f) D for a and 1 - D / 2 for z', with D = gamma h d/du + beta h^2 d/dq for columns of u, and h d/dz for those
of z. First a simplified iteration is made with the Jacobian that is there, then with a new one; with fixed steps at
last a damped one with a new Jacobian at every iterate, where friction saturates within the step.

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

from flexclear.pipeline.core.integrators import INTEGRATORS
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import hermite
from flexclear.pipeline.dynamics.integrate.method import Method, slope
from flexclear.pipeline.dynamics.integrate.newton import PERTURBATION, converged, limit, lu_factor, lu_solve
from flexclear.pipeline.dynamics.integrate.norms import error_scale, finite, scaled_norm, set_error_scales
from flexclear.pipeline.dynamics.kernels import kernel

# rows of SLOPES: start of the step, Newton's iterate, end of the step, estimates, search for events
ITERATE, LAST, ESTIMATE, ROWS = 1, 2, 3, 5
#: iterations of the simplified kind, and from which number on they ask for a new Jacobian at the next step
MOST_ITERATIONS, SLOW = 10, 4
#: iterations of the damped kind, and halvings of one correction
MOST_CORRECTIONS, MOST_HALVINGS = 30, 12

# Memory between steps ------------------------------------------------------------------------------------------------
# step to which the stored accelerations belong, step of the factors, whether the Jacobian still holds, step before;
# then vectors of rates, positions, the slope before the last step, matrices
A_STEP, FACTORED_STEP, JACOBIAN_HOLDS, LAST_STEP, VECTORS = range(5)
#: accelerations at the start as stored, rates at the end, accelerations at the start for this step's length,
#: displacement, residual, Newton's correction, row exchanges of the factors
OLD, NEW, RESCALED, DISPLACEMENT, RESIDUAL, CORRECTION, PIVOTS, N_VECTORS = range(8)
#: change of the rates with speeds and z, with positions, and Newton's matrix
BY_STATE, BY_POSITION, NEWTON = range(3)


def memory(h: np.ndarray) -> int:
    """Floats kept between steps."""
    nq, ny = int(h[m.NQ]), int(h[m.NY])
    return VECTORS + N_VECTORS * (ny - nq) + nq + ny + 3 * (ny - nq) ** 2


@kernel
def n_rates(h):
    """Number of unknowns."""
    return h[m.NY] - h[m.NQ]


@kernel
def vector(h, k):
    """Where w holds one of the vectors."""
    return h[m.MEMORY] + VECTORS + n_rates(h) * k


@kernel
def positions(h):
    """Where w has room for positions."""
    return vector(h, N_VECTORS)


@kernel
def slope_before(h):
    """Where w holds the slope at the start of the step before."""
    return positions(h) + h[m.NQ]


@kernel
def matrix(h, k):
    """Where w holds one of the matrices."""
    return slope_before(h) + h[m.NY] + n_rates(h) * n_rates(h) * k


# Coefficients and linear system --------------------------------------------------------------------------------------
def parameter(solver: Any) -> float:
    """Spectral radius at infinite frequency."""
    return float(solver.rho_inf)


@kernel
def coefficients(h, w):
    """alpha_m, alpha_f, beta and gamma for the spectral radius at infinity."""
    r = w[h[m.CONTROL] + m.PARAMETER]
    alpha_m, alpha_f = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    return alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma


@kernel
def own_weight(h, w, i):
    """Weight of unknown i itself in its equation."""
    return 1.0 - coefficients(h, w)[0] if i < h[m.NV] else 1.0


@kernel
def gain(h, w, step, i):
    """Change of speed or variable i at the end of the step with its rate there."""
    return coefficients(h, w)[3] * step if i < h[m.NV] else step


@kernel
def factorise(h, w, step):
    """Newton's matrix for a step, factorised; False when it is singular."""
    _, alpha_f, beta, _ = coefficients(h, w)
    size, nv = n_rates(h), h[m.NV]
    S, by_state, by_position = matrix(h, NEWTON), matrix(h, BY_STATE), matrix(h, BY_POSITION)
    for i in range(size):
        weight = 1.0 - alpha_f if i < nv else 0.5
        for k in range(size):
            change = gain(h, w, step, k) * w[by_state + size * i + k]
            if k < nv:
                change += beta * step * step * w[by_position + size * i + k]
            w[S + size * i + k] = -weight * change
        w[S + (size + 1) * i] += own_weight(h, w, i)
    w[h[m.MEMORY] + FACTORED_STEP] = step
    return lu_factor(w, S, vector(h, PIVOTS), size)


@kernel
def solve(h, w, b):
    """Solve Newton's system in place for the right-hand side from place b."""
    lu_solve(w, matrix(h, NEWTON), vector(h, PIVOTS), n_rates(h), b)


@kernel
def rates_norm(h, w, step, a):
    """What rates from place a make of the state, in units of the tolerance."""
    total, count = 0.0, n_rates(h)
    for i in range(count):
        total += (gain(h, w, step, i) * w[a + i] / error_scale(h, w, h[m.NQ] + i)) ** 2
    return np.sqrt(total / count)


# From step to step ---------------------------------------------------------------------------------------------------
@kernel
def predict(h, w, step):
    """Accelerations at the start for a step of this length, and a first guess of the rates at its end."""
    o, nq = h[m.MEMORY], h[m.NQ]
    share, on = step / w[o + A_STEP], step / w[o + LAST_STEP]
    for k in range(h[m.NV]):
        now = w[h[m.SLOPES] + nq + k]
        a = now + share * (w[vector(h, OLD) + k] - now)
        w[vector(h, RESCALED) + k] = a
        w[vector(h, NEW) + k] = a + on * (now - w[slope_before(h) + nq + k])
    for k in range(h[m.NV], n_rates(h)):
        w[vector(h, NEW) + k] = w[h[m.SLOPES] + nq + k]


@kernel
def keep(h, f, w, n, step):
    """The end of an accepted step is the start of the next."""
    o = h[m.MEMORY]
    for k in range(h[m.NV]):
        w[vector(h, OLD) + k] = w[vector(h, NEW) + k]
    for c in range(h[m.NY]):
        w[slope_before(h) + c] = w[h[m.SLOPES] + c]
    w[o + A_STEP] = w[o + LAST_STEP] = step


@kernel
def error(h, f, w, n, step):
    """Norm of the local error, 1 at the tolerance."""
    size, start, end, before = h[m.NY], slope(h, 0), slope(h, ITERATE), slope_before(h)
    out, length = slope(h, ESTIMATE), w[h[m.MEMORY] + LAST_STEP]
    for c in range(size):
        f0, f1 = w[start + c], w[end + c]
        bend = ((f1 - f0) / step - (f0 - w[before + c]) / length) / (step + length)
        integral = 0.5 * step * (f0 + f1) - step**3 / 6.0 * bend
        w[out + c] = w[h[m.Y_NEW] + c] - w[h[m.Y] + c] - integral
    for k in range(n_rates(h)):
        w[out + h[m.NQ] + k] *= own_weight(h, w, k)
    solve(h, w, out + h[m.NQ])
    return scaled_norm(h, w, out)


def make_kernels(evaluate: Callable, retract: Callable) -> tuple:
    """The method's kernels."""
    place_end, solve_step = make_newton(evaluate, retract)

    @kernel
    def begin(h, f, w, n):
        """Accelerations at their own time, from a look ahead along the tangent."""
        alpha_m, alpha_f, _, _ = coefficients(h, w)
        o, size, first, step = h[m.MEMORY], h[m.NY], slope(h, 0), w[h[m.CONTROL] + m.STEP]
        ahead = slope(h, ITERATE)
        for c in range(size):
            w[h[m.Y_STAGE] + c] = w[h[m.Y] + c] + step * w[first + c]
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + step, h[m.Y_STAGE], ahead)
        n[m.EVALUATIONS] += 1
        seen = n[m.EVALUATION] == m.OK and finite(h, w, ahead)
        for c in range(size):
            change = w[ahead + c] - w[first + c] if seen else 0.0
            w[slope_before(h) + c] = w[first + c] - change
            if h[m.NQ] <= c < h[m.NQ] + h[m.NV]:
                w[vector(h, OLD) + c - h[m.NQ]] = w[first + c] + (alpha_m - alpha_f) * change
        w[o + A_STEP] = w[o + LAST_STEP] = step
        w[o + JACOBIAN_HOLDS] = 0.0
        n[m.EVALUATION] = m.OK

    @kernel
    def attempt(h, f, w, n, step):
        """State Y_NEW after a step from Y; False when no iteration converges."""
        set_error_scales(h, f, w, h[m.Y])
        if not solve_step(h, f, w, n, step):
            return False
        place_end(h, f, w, n, step, h[m.Y_NEW])
        return True

    return begin, attempt, error, hermite.make_extend(LAST), keep


def make_newton(evaluate: Callable, retract: Callable) -> tuple[Callable, Callable]:
    """The kernels place_end(h, f, w, n, step, out) and solve_step(h, f, w, n, step)."""
    jacobian = make_jacobian(evaluate, retract)

    @kernel
    def place_end(h, f, w, n, step, out):
        """State at the end of the step for the rates in NEW."""
        _, _, beta, gamma = coefficients(h, w)
        nq, nv, old, new, shift = h[m.NQ], h[m.NV], vector(h, RESCALED), vector(h, NEW), vector(h, DISPLACEMENT)
        for k in range(nv):
            a, b, u = w[old + k], w[new + k], w[h[m.Y] + nq + k]
            w[shift + k] = step * (u + step * ((0.5 - beta) * a + beta * b))
            w[out + nq + k] = u + step * ((1.0 - gamma) * a + gamma * b)
        for k in range(nv, n_rates(h)):
            w[out + nq + k] = w[h[m.Y] + nq + k] + step * w[new + k]
        retract(h, f, w, n, h[m.Y], shift, out, positions(h))

    @kernel
    def residual(h, f, w, n, step):
        """What the rates in NEW leave of the method's equations, into RESIDUAL; False without a slope."""
        alpha_m, alpha_f, _, _ = coefficients(h, w)
        nq, old, start, end = h[m.NQ], vector(h, RESCALED), slope(h, 0), slope(h, ITERATE)
        place_end(h, f, w, n, step, h[m.Y_NEW])
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + step, h[m.Y_NEW], end)
        n[m.EVALUATIONS] += 1
        for i in range(n_rates(h)):
            first, last = w[start + nq + i], w[end + nq + i]
            if i < h[m.NV]:
                due = (1.0 - alpha_f) * last + alpha_f * first - alpha_m * w[old + i]
            else:
                due = 0.5 * (first + last)
            w[vector(h, RESIDUAL) + i] = due - own_weight(h, w, i) * w[vector(h, NEW) + i]
        return n[m.EVALUATION] == m.OK

    @kernel
    def iterate(h, f, w, n, step):
        """Newton's iterations with the matrix as it is; their number, or 0 when they do not converge."""
        left, last_norm = vector(h, RESIDUAL), 0.0
        for k in range(MOST_ITERATIONS):
            if not residual(h, f, w, n, step):
                return 0
            solve(h, w, left)
            for i in range(n_rates(h)):
                w[vector(h, NEW) + i] += w[left + i]
            norm = rates_norm(h, w, step, left)
            verdict = converged(k, norm, last_norm, w[h[m.CONTROL] + m.RTOL])
            if verdict != 0:
                return k + 1 if verdict > 0 else 0
            last_norm = norm
        return 0

    @kernel
    def line_search(h, f, w, n, step, norm):
        """Take the correction, or the share of it that makes the residual less; what is left of it, or -1."""
        correction, new = vector(h, CORRECTION), vector(h, NEW)
        share, there = 1.0, 0.0
        for _ in range(MOST_HALVINGS):
            for i in range(n_rates(h)):
                w[new + i] += (share - there) * w[correction + i]
            if residual(h, f, w, n, step):
                left = rates_norm(h, w, step, vector(h, RESIDUAL))
                if left < (1.0 - 0.1 * share) * norm:
                    return left
            there = share
            share *= 0.5
        return -1.0

    @kernel
    def iterate_damped(h, f, w, n, step):
        """Damped Newton iterations with a new matrix each: for friction that saturates within a step."""
        t, enough = w[h[m.CONTROL] + m.TIME] + step, limit(w[h[m.CONTROL] + m.RTOL])
        correction = vector(h, CORRECTION)
        if not residual(h, f, w, n, step):
            return False
        left = rates_norm(h, w, step, vector(h, RESIDUAL))
        for _ in range(MOST_CORRECTIONS):
            if not jacobian(h, f, w, n, t, h[m.Y_NEW], slope(h, ITERATE)) or not factorise(h, w, step):
                return False
            for i in range(n_rates(h)):
                w[correction + i] = w[vector(h, RESIDUAL) + i]
            solve(h, w, correction)
            norm = rates_norm(h, w, step, correction)
            left = line_search(h, f, w, n, step, left)
            if norm <= enough or left == 0.0:
                return True
            if left < 0.0:
                return False
        return False

    @kernel
    def solve_step(h, f, w, n, step):
        """Rates at the end of the step into NEW; False when no iteration converges.

        With chosen steps a shorter one is the better remedy, with fixed steps it is patience.
        """
        o = h[m.MEMORY]
        for _ in range(2):
            fresh = w[o + JACOBIAN_HOLDS] == 0.0
            if fresh and not jacobian(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y], slope(h, 0)):
                return False
            if w[o + FACTORED_STEP] != step and not factorise(h, w, step):
                return False
            predict(h, w, step)
            count = iterate(h, f, w, n, step)
            if count > 0:
                w[o + JACOBIAN_HOLDS] = 1.0 if count <= SLOW else 0.0
                return True
            w[o + JACOBIAN_HOLDS] = 0.0
            if fresh:
                break
        if w[h[m.CONTROL] + m.FIXED] > 0.0:
            predict(h, w, step)
            return iterate_damped(h, f, w, n, step)
        return False

    return place_end, solve_step


def make_jacobian(evaluate: Callable, retract: Callable) -> Callable:
    """The kernel jacobian(h, f, w, n, t, y, slope_there)."""

    @kernel
    def column(h, f, w, n, t, slope_there, k, change, target):
        """Column k of a Jacobian of the rates, from the changed state in Y_STAGE."""
        size, nq, near = n_rates(h), h[m.NQ], slope(h, ESTIMATE)
        evaluate(h, f, w, n, t, h[m.Y_STAGE], near)
        n[m.EVALUATIONS] += 1
        for i in range(size):
            w[target + size * i + k] = (w[near + nq + i] - w[slope_there + nq + i]) / change
        return n[m.EVALUATION] == m.OK

    @kernel
    def jacobian(h, f, w, n, t, y, slope_there):
        """Change of the rates with speeds and z, and with displacements, at the state in y; False without a slope."""
        nv, nq, shift = h[m.NV], h[m.NQ], vector(h, DISPLACEMENT)
        for c in range(h[m.NY]):
            w[h[m.Y_STAGE] + c] = w[y + c]
        for k in range(n_rates(h)):
            floor, value = f[m.FLOORS.row(h, m.GROUPS.group(h, nq + k)) + m.FLOORS.natural], w[y + nq + k]
            changed = value + PERTURBATION * (floor + abs(value))
            w[h[m.Y_STAGE] + nq + k] = changed
            if not column(h, f, w, n, t, slope_there, k, changed - value, matrix(h, BY_STATE)):
                return False
            w[h[m.Y_STAGE] + nq + k] = value
        for k in range(nv):
            change = PERTURBATION * f[m.FLOORS.row(h, m.GROUPS.group(h, nq + k)) + m.FLOORS.natural]
            for j in range(nv):
                w[shift + j] = change if j == k else 0.0
            retract(h, f, w, n, y, shift, h[m.Y_STAGE], positions(h))
            if not column(h, f, w, n, t, slope_there, k, change, matrix(h, BY_POSITION)):
                return False
        n[m.JACOBIANS] += 1
        w[h[m.MEMORY] + JACOBIAN_HOLDS], w[h[m.MEMORY] + FACTORED_STEP] = 1.0, 0.0
        return True

    return jacobian


METHOD = Method(
    traits=INTEGRATORS["generalized-alpha"],
    slopes=ROWS,
    last=LAST,
    dense=hermite.ROWS,
    make_kernels=make_kernels,
    interpolate=hermite.interpolate,
    error_order=2,
    steady=1.2,
    memory=memory,
    parameter=parameter,
)
