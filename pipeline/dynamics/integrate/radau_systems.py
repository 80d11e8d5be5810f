"""Memory and linear systems of the Radau method: a real and a complex one per step.

The systems are mu / h - J for the three eigenvalues mu of the inverse Butcher matrix.
"""

from __future__ import annotations

from pipeline.dynamics import memory as m
from pipeline.dynamics.integrate import lu
from pipeline.dynamics.kernels import kernel

#: eigenvalues of the inverse of the Butcher matrix: a real one and MU_REST +- i MU_IMAG
MU_REAL = 3.0 + 3.0 ** (2.0 / 3.0) - 3.0 ** (1.0 / 3.0)
MU_REST = 3.0 + 0.5 * (3.0 ** (1.0 / 3.0) - 3.0 ** (2.0 / 3.0))
MU_IMAG = -0.5 * (3.0 ** (5.0 / 6.0) + 3.0 ** (7.0 / 6.0))
# memory: step of the factors, whether the Jacobian holds, step before; then vectors over the state: three stages,
# the same transformed, their corrections, the last polynomial; then the matrices and their pivots
LU_STEP, VALID, OLD_STEP, VECTORS = range(4)
Z, TRANSFORMED, CORRECTION, POLYNOMIAL = range(4)
N_VECTORS = 13


def memory(nq: int, nv: int, ny: int) -> int:
    """Floats kept between steps."""
    return VECTORS + N_VECTORS * ny + 4 * ny * ny + 2 * ny


@kernel
def stage_vector(h, kind, i):
    """Where w holds vector i of a kind."""
    return h[m.MEMORY] + VECTORS + h[m.NY] * (3 * kind + i)


@kernel
def old(h):
    """Where w holds the polynomial of the step before: four vectors."""
    return stage_vector(h, POLYNOMIAL, 0)


@kernel
def jacobian_entry(h, i, k):
    """Place of an entry of the Jacobian."""
    return h[m.MEMORY] + VECTORS + h[m.NY] * N_VECTORS + h[m.NY] * i + k


@kernel
def factors(h, k):
    """Place of the real system's factors (0), the complex one's (1), or what follows them (3)."""
    size = h[m.NY]
    return jacobian_entry(h, h[m.NY], 0) + k * size * size


@kernel
def factorise(h, w, step):
    """Both systems for a step; False when one is singular."""
    size, real, rest = h[m.NY], factors(h, 0), factors(h, 1)
    pivots = factors(h, 3)
    for i in range(size):
        for k in range(size):
            entry, o = w[jacobian_entry(h, i, k)], size * i + k
            w[real + o] = w[rest + o] = -entry
            w[rest + size * size + o] = 0.0
        w[real + (size + 1) * i] += MU_REAL / step
        w[rest + (size + 1) * i] += MU_REST / step
        w[rest + size * size + (size + 1) * i] = MU_IMAG / step
    w[h[m.MEMORY] + LU_STEP] = step
    return lu.factor(w, real, pivots, size) and lu.factor_complex(w, rest, pivots + size, size)


@kernel
def solve_real(h, w, b):
    """Solve the real system in place for the right-hand side from place b."""
    lu.solve(w, factors(h, 0), factors(h, 3), h[m.NY], b)


@kernel
def solve_pair(h, w, b, d):
    """Solve the complex system in place: real part of the right-hand side from place b, imaginary part from d."""
    lu.solve_complex(w, factors(h, 1), factors(h, 3) + h[m.NY], h[m.NY], b, d)
