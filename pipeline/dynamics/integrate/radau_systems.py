"""Memory and linear systems of the Radau method: a real and a complex one per step, ledger rows apart.

The systems are mu / h - J for the three eigenvalues mu of the inverse Butcher matrix. J has a row for every state
variable and a column for every position and speed; ledger rows follow from the solution by substitution.
"""

from __future__ import annotations

from pipeline.dynamics.integrate import lu
from pipeline.dynamics.tables import MEMORY, NQ, NV, NY
from pipeline.dynamics.vectors import index, kernel

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
    m = nq + nv
    return VECTORS + N_VECTORS * ny + ny * m + 3 * m * m + 2 * m


@kernel
def dynamic(h):
    """Number of positions and speeds."""
    return h[NQ] + h[NV]


@kernel
def stage_vector(h, kind, i):
    """Where w holds vector i of a kind."""
    return h[MEMORY] + VECTORS + h[NY] * (3 * kind + i)


@kernel
def old(h):
    """Where w holds the polynomial of the step before: four vectors."""
    return stage_vector(h, POLYNOMIAL, 0)


@kernel
def jacobian_entry(h, i, k):
    """Place of an entry of the Jacobian."""
    return h[MEMORY] + VECTORS + h[NY] * N_VECTORS + dynamic(h) * i + k


@kernel
def factors(h, k):
    """Place of the real system's factors (0), the complex one's (1), or what follows them (3)."""
    m = dynamic(h)
    return jacobian_entry(h, h[NY], 0) + k * m * m


@kernel
def factorise(h, w, step):
    """Both systems for a step; False when one is singular."""
    m, real, rest = dynamic(h), factors(h, 0), factors(h, 1)
    pivots = factors(h, 3)
    for i in range(m):
        for k in range(m):
            entry, o = w[index(jacobian_entry(h, i, k))], m * i + k
            w[index(real + o)] = w[index(rest + o)] = -entry
            w[index(rest + m * m + o)] = 0.0
        w[index(real + (m + 1) * i)] += MU_REAL / step
        w[index(rest + (m + 1) * i)] += MU_REST / step
        w[index(rest + m * m + (m + 1) * i)] = MU_IMAG / step
    w[index(h[MEMORY] + LU_STEP)] = step
    return lu.factor(w, real, pivots, m) and lu.factor_complex(w, rest, pivots + m, m)


@kernel
def solve_real(h, w, step, b):
    """Solve the real system in place for the right-hand side from place b."""
    m = dynamic(h)
    lu.solve(w, factors(h, 0), factors(h, 3), m, b)
    for i in range(m, h[NY]):
        total = w[index(b + i)]
        for k in range(m):
            total += w[index(jacobian_entry(h, i, k))] * w[index(b + k)]
        w[index(b + i)] = total * step / MU_REAL


@kernel
def solve_pair(h, w, step, b, d):
    """Solve the complex system in place: real part of the right-hand side from place b, imaginary part from d."""
    m, size = dynamic(h), MU_REST * MU_REST + MU_IMAG * MU_IMAG
    lu.solve_complex(w, factors(h, 1), factors(h, 3) + m, m, b, d)
    for i in range(m, h[NY]):
        p, q = w[index(b + i)], w[index(d + i)]
        for k in range(m):
            entry = w[index(jacobian_entry(h, i, k))]
            p += entry * w[index(b + k)]
            q += entry * w[index(d + k)]
        w[index(b + i)] = step * (p * MU_REST + q * MU_IMAG) / size
        w[index(d + i)] = step * (q * MU_REST - p * MU_IMAG) / size
