"""Newton iterations of the generalized-alpha method, for the rates at the end of a step.

First a simplified iteration with the Jacobian that is there, then with a new one; with fixed steps at last a damped
one with a new Jacobian at every iterate, where friction saturates within the step.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate.alpha_system import (
    A_STEP,
    BY_POSITION,
    BY_STATE,
    CORRECTION,
    LU_STEP,
    NEW,
    OLD,
    RESIDUAL,
    SCALED,
    SHIFT,
    STEP_BEFORE,
    VALID,
    before,
    constants,
    diagonal,
    factorise,
    matrix,
    positions,
    rates,
    reach,
    solve,
    vector,
)
from pipeline.dynamics.integrate.newton import converged, limit
from pipeline.dynamics.kernels import kernel

# rows of SLOPES: Newton's iterate, and what is tried beside it
ITERATE, ESTIMATE = 1, 3
MOST_ITERATIONS, SLOW, MOST_CORRECTIONS, MOST_HALVINGS = 10, 4, 30, 12
#: perturbation of a Jacobian's column, relative to the variable's size: root of the rounding error
NUDGE = 1e-8


def compose(evaluate: Callable, retract: Callable) -> tuple[Callable, Callable]:
    """The kernels place(h, w, step, out) and converge(h, f, w, n, step)."""

    @kernel
    def column(h, f, w, n, t, slope, k, nudge, target):
        """Column k of a Jacobian of the rates, from the nudged state in Y_STAGE."""
        n_rates, nq, near = rates(h), h[m.NQ], h[m.SLOPES] + h[m.NY] * ESTIMATE
        evaluate(h, f, w, n, t, h[m.Y_STAGE], near)
        n[m.EVALUATIONS] += 1
        for i in range(n_rates):
            w[target + n_rates * i + k] = (w[near + nq + i] - w[slope + nq + i]) / nudge
        return n[m.EVALUATION] == m.OK

    @kernel
    def jacobian(h, f, w, n, t, y, slope):
        """Change of the rates with speeds and what follows them, and with displacements, at the state in y."""
        nv, nq, shift = h[m.NV], h[m.NQ], vector(h, SHIFT)
        for c in range(h[m.NY]):
            w[h[m.Y_STAGE] + c] = w[y + c]
        for k in range(rates(h)):
            size, value = f[m.FLOORS.row(h, m.GROUPS.group(h, nq + k))], w[y + nq + k]
            nudged = value + NUDGE * (size + abs(value))
            w[h[m.Y_STAGE] + nq + k] = nudged
            if not column(h, f, w, n, t, slope, k, nudged - value, matrix(h, BY_STATE)):
                return False
            w[h[m.Y_STAGE] + nq + k] = value
        for k in range(nv):
            nudge = NUDGE * f[m.FLOORS.row(h, m.GROUPS.group(h, nq + k))]
            for j in range(nv):
                w[shift + j] = nudge if j == k else 0.0
            retract(h, w, y, shift, h[m.Y_STAGE], positions(h))
            if not column(h, f, w, n, t, slope, k, nudge, matrix(h, BY_POSITION)):
                return False
        n[m.JACOBIANS] += 1
        w[h[m.MEMORY] + VALID], w[h[m.MEMORY] + LU_STEP] = 1.0, 0.0
        return True

    @kernel
    def place(h, w, step, out):
        """State at the end of the step for the rates in NEW."""
        _, _, beta, gamma = constants(h, w)
        nq, nv, old, new, shift = h[m.NQ], h[m.NV], vector(h, SCALED), vector(h, NEW), vector(h, SHIFT)
        for k in range(nv):
            a, b, u = w[old + k], w[new + k], w[h[m.Y] + nq + k]
            w[shift + k] = step * (u + step * ((0.5 - beta) * a + beta * b))
            w[out + nq + k] = u + step * ((1.0 - gamma) * a + gamma * b)
        for k in range(nv, rates(h)):
            w[out + nq + k] = w[h[m.Y] + nq + k] + step * w[new + k]
        retract(h, w, h[m.Y], shift, out, positions(h))

    @kernel
    def misfit(h, f, w, n, step):
        """What the rates in NEW leave of the method's equations, into RESIDUAL; False without a slope."""
        alpha_m, alpha_f, _, _ = constants(h, w)
        nq, old, start_slope, slope = h[m.NQ], vector(h, SCALED), h[m.SLOPES], h[m.SLOPES] + h[m.NY] * ITERATE
        place(h, w, step, h[m.Y_NEW])
        evaluate(h, f, w, n, w[h[m.CONTROL] + m.TIME] + step, h[m.Y_NEW], slope)
        n[m.EVALUATIONS] += 1
        for i in range(rates(h)):
            first, last = w[start_slope + nq + i], w[slope + nq + i]
            if i < h[m.NV]:
                wanted = (1.0 - alpha_f) * last + alpha_f * first - alpha_m * w[old + i]
            else:
                wanted = 0.5 * (first + last)
            w[vector(h, RESIDUAL) + i] = wanted - diagonal(h, w, i) * w[vector(h, NEW) + i]
        return n[m.EVALUATION] == m.OK

    @kernel
    def size_of(h, w, step, a):
        """What rates from place a make of the state, in units of the tolerance."""
        total, n_rates = 0.0, rates(h)
        for i in range(n_rates):
            scale = w[h[m.MAGNITUDE] + m.GROUPS.group(h, h[m.NQ] + i)]
            total += (reach(h, w, step, i) * w[a + i] / scale) ** 2
        return np.sqrt(total / n_rates)

    @kernel
    def iterate(h, f, w, n, step):
        """Newton's iterations with the matrix as it is; their number, or 0 when they do not converge."""
        residual, last_norm = vector(h, RESIDUAL), 0.0
        for k in range(MOST_ITERATIONS):
            if not misfit(h, f, w, n, step):
                return 0
            solve(h, w, residual)
            for i in range(rates(h)):
                w[vector(h, NEW) + i] += w[residual + i]
            norm = size_of(h, w, step, residual)
            verdict = converged(k, norm, last_norm, w[h[m.CONTROL] + m.RTOL])
            if verdict != 0:
                return k + 1 if verdict > 0 else 0
            last_norm = norm
        return 0

    @kernel
    def shorten(h, f, w, n, step, norm):
        """Take the correction, or the share of it that makes the misfit less; the misfit left, or -1."""
        correction, new, residual = vector(h, CORRECTION), vector(h, NEW), vector(h, RESIDUAL)
        share, there = 1.0, 0.0
        for _ in range(MOST_HALVINGS):
            for i in range(rates(h)):
                w[new + i] += (share - there) * w[correction + i]
            if misfit(h, f, w, n, step):
                left = size_of(h, w, step, residual)
                if left < (1.0 - 0.1 * share) * norm:
                    return left
            there = share
            share *= 0.5
        return -1.0

    @kernel
    def persist(h, f, w, n, step):
        """Damped Newton iterations with a new matrix each: for friction that saturates within a step."""
        t, enough = w[h[m.CONTROL] + m.TIME] + step, limit(w[h[m.CONTROL] + m.RTOL])
        correction, residual = vector(h, CORRECTION), vector(h, RESIDUAL)
        if not misfit(h, f, w, n, step):
            return False
        left = size_of(h, w, step, residual)
        for _ in range(MOST_CORRECTIONS):
            if not jacobian(h, f, w, n, t, h[m.Y_NEW], h[m.SLOPES] + h[m.NY] * ITERATE) or not factorise(h, w, step):
                return False
            for i in range(rates(h)):
                w[correction + i] = w[residual + i]
            solve(h, w, correction)
            norm = size_of(h, w, step, correction)
            left = shorten(h, f, w, n, step, left)
            if norm <= enough or left == 0.0:
                return True
            if left < 0.0:
                return False
        return False

    @kernel
    def start(h, w, step):
        """Rates at the start for a step of this length, and a first guess of those at its end."""
        o, nq = h[m.MEMORY], h[m.NQ]
        share, on = step / w[o + A_STEP], step / w[o + STEP_BEFORE]
        for k in range(h[m.NV]):
            now = w[h[m.SLOPES] + nq + k]
            a = now + share * (w[vector(h, OLD) + k] - now)
            w[vector(h, SCALED) + k] = a
            w[vector(h, NEW) + k] = a + on * (now - w[before(h) + nq + k])
        for k in range(h[m.NV], rates(h)):
            w[vector(h, NEW) + k] = w[h[m.SLOPES] + nq + k]

    @kernel
    def converge(h, f, w, n, step):
        """Rates at the end of the step into NEW; False when no iteration converges.

        With chosen steps a shorter one is the better remedy, with fixed steps it is patience.
        """
        o = h[m.MEMORY]
        for _ in range(2):
            fresh = w[o + VALID] == 0.0
            if fresh and not jacobian(h, f, w, n, w[h[m.CONTROL] + m.TIME], h[m.Y], h[m.SLOPES]):
                return False
            if w[o + LU_STEP] != step and not factorise(h, w, step):
                return False
            start(h, w, step)
            count = iterate(h, f, w, n, step)
            if count > 0:
                w[o + VALID] = 1.0 if count <= SLOW else 0.0
                return True
            w[o + VALID] = 0.0
            if fresh:
                break
        if w[h[m.CONTROL] + m.FIXED] > 0.0:
            start(h, w, step)
            return persist(h, f, w, n, step)
        return False

    return place, converge
