"""Termination of simplified Newton iterations, and LU factors of small dense systems, for implicit methods.

Matrices are stored in the work array row by row, complex ones as a real and an imaginary matrix.

Source: Hairer & Wanner, *Solving Ordinary Differential Equations II*, 2nd ed. (1996), sec. IV.8 (end of the
iteration); Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), alg. 3.4.1 (LU factors with row exchanges).
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel

#: the remaining error may be this fraction of the tolerance, or ten roundings if that is more
TOLERANCE_FRACTION, TEN_ROUNDINGS = 1e-2, 2.2e-15
#: a first correction this far below the limit needs no second one to know how fast they fall
SMALL_CORRECTION = 1e-3
#: perturbation of a Jacobian's column, relative to the variable's size: root of the rounding error
COLUMN_STEP = 1e-8


@kernel
def limit(rtol):
    """Return the norm of the admissible remaining error, in units of the tolerance."""
    return max(TOLERANCE_FRACTION, TEN_ROUNDINGS / rtol)


@kernel
def converged(k, norm, last_norm, rtol):
    """Return 1 when correction k (norm in units of the tolerance) was the last one, -1 on divergence, else 0."""
    enough = limit(rtol)
    if not norm <= 1e300:
        return -1
    if k == 0:
        return 1 if norm <= SMALL_CORRECTION * enough else 0
    rate = norm / last_norm
    if rate < 1.0 and rate / (1.0 - rate) * norm < enough:
        return 1
    if rate >= 1.0:
        return 1 if norm <= enough else -1
    return 0


@kernel
def exchange_rows(w, a, b, n):
    """Exchange n entries of w from a with those from b."""
    for k in range(n):
        w[a + k], w[b + k] = w[b + k], w[a + k]


@kernel
def lu_factor(w, a, pivots, n):
    """Overwrite the matrix at index a by its factors; return False when it is singular or not finite."""
    for k in range(n):
        best, row = abs(w[a + n * k + k]), k
        for i in range(k + 1, n):
            if abs(w[a + n * i + k]) > best:
                best, row = abs(w[a + n * i + k]), i
        w[pivots + k] = row
        if not 0.0 < best < 1e300:
            return False
        if row != k:
            exchange_rows(w, a + n * k, a + n * row, n)
        inverse = 1.0 / w[a + n * k + k]
        for i in range(k + 1, n):
            left = w[a + n * i + k] * inverse
            w[a + n * i + k] = left
            if left != 0.0:
                for j in range(k + 1, n):
                    w[a + n * i + j] -= left * w[a + n * k + j]
    return True


@kernel
def lu_solve(w, a, pivots, n, b):
    """Solve in place for the right-hand side at index b."""
    for k in range(n):
        row = int(w[pivots + k])
        w[b + k], w[b + row] = w[b + row], w[b + k]
    for i in range(n):
        total = w[b + i]
        for j in range(i):
            total -= w[a + n * i + j] * w[b + j]
        w[b + i] = total
    for i in range(n - 1, -1, -1):
        total = w[b + i]
        for j in range(i + 1, n):
            total -= w[a + n * i + j] * w[b + j]
        w[b + i] = total / w[a + n * i + i]


@kernel
def lu_factor_complex(w, a, pivots, n):
    """Apply `lu_factor` to a complex matrix: real part at index a, imaginary part n n further."""
    c = a + n * n
    for k in range(n):
        best, row = -1.0, k
        for i in range(k, n):
            x, y = w[a + n * i + k], w[c + n * i + k]
            if x * x + y * y > best:
                best, row = x * x + y * y, i
        w[pivots + k] = row
        if not 0.0 < best < 1e300:
            return False
        if row != k:
            exchange_rows(w, a + n * k, a + n * row, n)
            exchange_rows(w, c + n * k, c + n * row, n)
        re, im = w[a + n * k + k] / best, -w[c + n * k + k] / best
        for i in range(k + 1, n):
            x, y = w[a + n * i + k], w[c + n * i + k]
            p, q = x * re - y * im, x * im + y * re
            w[a + n * i + k], w[c + n * i + k] = p, q
            if p != 0.0 or q != 0.0:
                for j in range(k + 1, n):
                    x, y = w[a + n * k + j], w[c + n * k + j]
                    w[a + n * i + j] -= p * x - q * y
                    w[c + n * i + j] -= p * y + q * x
    return True


@kernel
def lu_solve_complex(w, a, pivots, n, b, d):
    """Solve in place for a right-hand side with its real part at index b, its imaginary part at d."""
    c = a + n * n
    for k in range(n):
        row = int(w[pivots + k])
        w[b + k], w[b + row] = w[b + row], w[b + k]
        w[d + k], w[d + row] = w[d + row], w[d + k]
    for i in range(n):
        p, q = w[b + i], w[d + i]
        for j in range(i):
            x, y = w[a + n * i + j], w[c + n * i + j]
            p -= x * w[b + j] - y * w[d + j]
            q -= x * w[d + j] + y * w[b + j]
        w[b + i], w[d + i] = p, q
    for i in range(n - 1, -1, -1):
        p, q = w[b + i], w[d + i]
        for j in range(i + 1, n):
            x, y = w[a + n * i + j], w[c + n * i + j]
            p -= x * w[b + j] - y * w[d + j]
            q -= x * w[d + j] + y * w[b + j]
        x, y = w[a + n * i + i], w[c + n * i + i]
        size = x * x + y * y
        w[b + i], w[d + i] = (p * x + q * y) / size, (q * x - p * y) / size
