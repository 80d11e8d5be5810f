"""Newton's iteration of implicit methods: Jacobian by differences, termination, and LU factors of small dense systems.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.8 (end of the
iteration); Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), alg. 3.4.1 (LU factors with row exchanges).
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.method import matrix, slope
from flexclear.dynamics.kernels import kernel

# first floats that implicit methods store: step of the factors, whether the Jacobian still holds, length of the step
# before; and the first of their matrices
FACTORED_STEP, JACOBIAN_HOLDS, LAST_STEP, FLOATS = range(4)
JACOBIAN = 0


@kernel
def limit(rtol):
    """Return the norm of the admissible remaining error, in units of the tolerance."""
    # the remaining error may be this fraction of the tolerance, or ten roundings if that is more
    return max(1e-2, 2.2e-15 / rtol)


@kernel
def convergence(k, norm, last_norm, rtol):
    """Return 1 when correction k (norm in units of the tolerance) was the last one, -1 on divergence, else 0."""
    enough = limit(rtol)
    if not norm <= 1e300:
        return -1
    if k == 0:
        # a first correction this far below the limit needs no second one to know how fast they fall
        return 1 if norm <= 1e-3 * enough else 0
    rate = norm / last_norm
    if rate < 1.0 and rate / (1.0 - rate) * norm < enough:
        return 1
    if rate >= 1.0:
        return 1 if norm <= enough else -1
    return 0


def make_jacobian(evaluate: Callable) -> Callable:
    """Build the kernel jacobian(d, t, y, rates, near): derivatives of all rates by all variables, in matrix JACOBIAN.

    y, rates, near: indices in w of the state, of its rates, and of a row of SLOPES to work with.
    """

    @kernel
    def jacobian(d, t, y, rates, near):
        """Compute the derivatives; works and losses have none. Return False when the right-hand side fails."""
        size, J = d.ny, matrix(d, JACOBIAN)
        works = d.nq + d.nv
        states = works + m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * d.n_contacts
        for c in range(size):
            d.y_stage[c] = d.w[y + c]
        for k in range(size):
            if works <= k < states:
                for i in range(size):
                    d.w[J + size * i + k] = 0.0
                continue
            value = d.w[y + k]
            # perturbation of a Jacobian's column, relative to the variable's size: root of the rounding error
            d.y_stage[k] = value + 1e-8 * (d.floors[d.groups[k].group].natural + abs(value))
            change = d.y_stage[k] - value
            evaluate(d, t, d.at_y_stage, near)
            d.evaluations += 1
            if d.evaluation != m.OK:
                return False
            for i in range(size):
                d.w[J + size * i + k] = (d.w[near + i] - d.w[rates + i]) / change
            d.y_stage[k] = value
        d.jacobians += 1
        d.memory[JACOBIAN_HOLDS], d.memory[FACTORED_STEP] = 1.0, 0.0
        return True

    return jacobian


def make_solve(jacobian: Callable, factorise: Callable, predict: Callable, iterate: Callable) -> Callable:
    """Build the kernel solve_step(d, step): iterations with the last Jacobian, then with a new one.

    factorise(d, step) -> False for a singular matrix.  predict(d, step): the first iterate.  iterate(d, step) -> rate
    at which the corrections fell, or -1 when they did not.
    """

    @kernel
    def solve_step(d, step):
        """Return False when no iteration converges."""
        for _ in range(2):
            fresh = d.memory[JACOBIAN_HOLDS] == 0.0
            if fresh and not jacobian(d, d.time, d.at_y, slope(d, 0), slope(d, 1)):
                return False
            if d.memory[FACTORED_STEP] != step and not factorise(d, step):
                return False
            predict(d, step)
            rate = iterate(d, step)
            if rate >= 0.0:
                # corrections that fall slower than this request a new Jacobian at the next step
                d.memory[JACOBIAN_HOLDS] = 1.0 if rate <= 0.3 else 0.0
                return True
            d.memory[JACOBIAN_HOLDS] = 0.0
            if fresh:
                return False
        return False

    return solve_step


def make_lu(entry: Callable, put: Callable) -> tuple[Callable, Callable]:
    """Build lu_factor(w, a, pivots, n) and lu_solve(w, a, pivots, n, b), for a matrix row by row.

    a, pivots, b: indices in w of the matrix, of the row exchanges, and of the right-hand side.  entry(w, a, k) and
    put(w, a, k, value): number k from index a on.
    """

    @kernel
    def exchange(w, a, j, k):
        """Exchange numbers j and k."""
        one = entry(w, a, j)
        put(w, a, j, entry(w, a, k))
        put(w, a, k, one)

    @kernel
    def lu_factor(w, a, pivots, n):
        """Overwrite the matrix by its factors; return False when it is singular or not finite."""
        for k in range(n):
            best, row = -1.0, k
            for i in range(k, n):
                if abs(entry(w, a, n * i + k)) > best:
                    best, row = abs(entry(w, a, n * i + k)), i
            w[pivots + k] = row
            if not 0.0 < best < 1e300:
                return False
            if row != k:
                for j in range(n):
                    exchange(w, a, n * k + j, n * row + j)
            inverse = 1.0 / entry(w, a, n * k + k)
            for i in range(k + 1, n):
                left = entry(w, a, n * i + k) * inverse
                put(w, a, n * i + k, left)
                if left != 0.0:
                    for j in range(k + 1, n):
                        put(w, a, n * i + j, entry(w, a, n * i + j) - left * entry(w, a, n * k + j))
        return True

    @kernel
    def lu_solve(w, a, pivots, n, b):
        """Solve in place."""
        for k in range(n):
            exchange(w, b, k, int(w[pivots + k]))
        for i in range(n):
            total = entry(w, b, i)
            for j in range(i):
                total -= entry(w, a, n * i + j) * entry(w, b, j)
            put(w, b, i, total)
        for i in range(n - 1, -1, -1):
            total = entry(w, b, i)
            for j in range(i + 1, n):
                total -= entry(w, a, n * i + j) * entry(w, b, j)
            put(w, b, i, total / entry(w, a, n * i + i))

    return lu_factor, lu_solve


@kernel
def real_entry(w, a, k):
    """Return real number k."""
    return w[a + k]


@kernel
def put_real(w, a, k, value):
    """Store real number k."""
    w[a + k] = value


@kernel
def complex_entry(w, a, k):
    """Return complex number k."""
    return complex(w[a + 2 * k], w[a + 2 * k + 1])


@kernel
def put_complex(w, a, k, value):
    """Store complex number k."""
    w[a + 2 * k], w[a + 2 * k + 1] = value.real, value.imag


lu_factor, lu_solve = make_lu(real_entry, put_real)
lu_factor_complex, lu_solve_complex = make_lu(complex_entry, put_complex)
