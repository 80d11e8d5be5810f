"""Memory, coefficients and Newton's matrix of the generalized-alpha method.

Its unknowns are the *rates*: the accelerations of the speeds u, then the rates of the first-order variables z that
follow them in the state (ledger, friction's own states). The matrix has rows (1 - alpha_m) - (1 - alpha_f) D for the
accelerations and 1 - D / 2 for z, with D = gamma h d/du + beta h^2 d/dq for columns of u, and h d/dz for those of z.
Source: Chung & Hulbert (1993), *J. Appl. Mech.* 60, 371-375, eqs. 17, 20 and 25.
"""

from __future__ import annotations

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate import lu
from pipeline.dynamics.kernels import kernel

# memory: step of the stored accelerations, step of the factors, whether the Jacobian holds, step before;
# then rates (old, new, old for this step's length), displacement, residual, correction, pivots,
# scratch for positions, slope before, and three matrices: by speeds, by positions, Newton's
A_STEP, LU_STEP, VALID, STEP_BEFORE, VECTORS = range(5)
OLD, NEW, SCALED, SHIFT, RESIDUAL, CORRECTION, PIVOTS, N_VECTORS = range(8)
BY_STATE, BY_POSITION, NEWTON = range(3)


def memory(nq: int, nv: int, ny: int) -> int:
    """Floats kept between steps."""
    return VECTORS + N_VECTORS * (ny - nq) + nq + ny + 3 * (ny - nq) ** 2


@kernel
def rates(h):
    """Number of unknowns."""
    return h[m.NY] - h[m.NQ]


@kernel
def vector(h, k):
    """Where w holds one of the vectors."""
    return h[m.MEMORY] + VECTORS + rates(h) * k


@kernel
def positions(h):
    """Scratch for positions."""
    return vector(h, N_VECTORS)


@kernel
def before(h):
    """Where w holds the slope before the last step."""
    return positions(h) + h[m.NQ]


@kernel
def matrix(h, k):
    """Where w holds a matrix."""
    return before(h) + h[m.NY] + rates(h) * rates(h) * k


@kernel
def constants(h, w):
    """alpha_m, alpha_f, beta and gamma for the spectral radius at infinity."""
    r = w[h[m.CONTROL] + m.PARAMETER]
    alpha_m, alpha_f = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
    gamma = 0.5 - alpha_m + alpha_f
    return alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma


@kernel
def diagonal(h, w, i):
    """Weight of unknown i itself in its equation."""
    return 1.0 - constants(h, w)[0] if i < h[m.NV] else 1.0


@kernel
def reach(h, w, step, i):
    """Change of speed or variable i at the end of the step with its rate there."""
    return constants(h, w)[3] * step if i < h[m.NV] else step


@kernel
def factorise(h, w, step):
    """Newton's matrix for a step, factorised; False when it is singular."""
    _, alpha_f, beta, _ = constants(h, w)
    size, nv = rates(h), h[m.NV]
    S, by_state, by_position = matrix(h, NEWTON), matrix(h, BY_STATE), matrix(h, BY_POSITION)
    for i in range(size):
        weight = 1.0 - alpha_f if i < nv else 0.5
        for k in range(size):
            change = reach(h, w, step, k) * w[by_state + size * i + k]
            if k < nv:
                change += beta * step * step * w[by_position + size * i + k]
            w[S + size * i + k] = -weight * change
        w[S + (size + 1) * i] += diagonal(h, w, i)
    w[h[m.MEMORY] + LU_STEP] = step
    return lu.factor(w, S, vector(h, PIVOTS), size)


@kernel
def solve(h, w, b):
    """Solve Newton's system in place for the right-hand side from place b."""
    lu.solve(w, matrix(h, NEWTON), vector(h, PIVOTS), rates(h), b)
