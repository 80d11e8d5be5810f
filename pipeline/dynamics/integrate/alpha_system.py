"""Memory, coefficients and Newton's matrix of the generalized-alpha method.

The matrix is that of the accelerations at the end of a step: (1 - alpha_m) - (1 - alpha_f) (gamma h du'/du + beta h^2
du'/dq), of the size of the speeds. Source: Chung & Hulbert (1993), *J. Appl. Mech.* 60, 371-375, eqs. 17, 20 and 25.
"""

from __future__ import annotations

from pipeline.dynamics.integrate import lu
from pipeline.dynamics.integrate.state import PARAMETER
from pipeline.dynamics.tables import CONTROL, MEMORY, NQ, NV, NY
from pipeline.dynamics.vectors import index, kernel

# memory: step of the stored accelerations, step of the factors, whether the Jacobian holds, step before;
# then accelerations (old, new, old for this step's length), displacement, residual, correction, pivots,
# scratch for positions, slope before, and three matrices: by speeds, by positions, Newton's
A_STEP, LU_STEP, VALID, STEP_BEFORE, VECTORS = range(5)
OLD, NEW, SCALED, SHIFT, RESIDUAL, CORRECTION, PIVOTS, N_VECTORS = range(8)
BY_SPEED, BY_POSITION, NEWTON = range(3)


def memory(nq: int, nv: int, ny: int) -> int:
    """Floats kept between steps."""
    return VECTORS + N_VECTORS * nv + nq + ny + 3 * nv * nv


@kernel
def vector(h, k):
    """Where w holds one of the vectors."""
    return h[MEMORY] + VECTORS + h[NV] * k


@kernel
def positions(h):
    """Scratch for positions."""
    return vector(h, N_VECTORS)


@kernel
def before(h):
    """Where w holds the slope before the last step."""
    return positions(h) + h[NQ]


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
def factorise(h, w, step):
    """Newton's matrix for a step, factorised; False when it is singular."""
    alpha_m, alpha_f, beta, gamma = constants(h, w)
    nv, S, by_speed, by_position = h[NV], matrix(h, NEWTON), matrix(h, BY_SPEED), matrix(h, BY_POSITION)
    for k in range(nv * nv):
        rate = gamma * step * w[index(by_speed + k)] + beta * step * step * w[index(by_position + k)]
        w[index(S + k)] = -(1.0 - alpha_f) * rate
    for k in range(nv):
        w[index(S + (nv + 1) * k)] += 1.0 - alpha_m
    w[index(h[MEMORY] + LU_STEP)] = step
    return lu.factor(w, S, vector(h, PIVOTS), nv)


@kernel
def solve(h, w, b):
    """Solve Newton's system in place for the right-hand side from place b."""
    lu.solve(w, matrix(h, NEWTON), vector(h, PIVOTS), h[NV], b)
