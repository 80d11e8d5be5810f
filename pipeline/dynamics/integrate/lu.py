"""Small dense systems in the work space: LU factors with row exchanges, real and complex.

Matrices are stored row by row, complex ones as a real and an imaginary matrix. Source: Golub & Van Loan,
*Matrix Computations*, 4th ed. (2013), alg. 3.4.1.
"""

from __future__ import annotations

from pipeline.dynamics.vectors import index, kernel


@kernel
def exchange(w, a, b, n):
    """Exchange two stretches of w."""
    for k in range(n):
        w[index(a + k)], w[index(b + k)] = w[index(b + k)], w[index(a + k)]


@kernel
def factor(w, a, pivots, n):
    """Overwrite the matrix from place a by its factors; False when it is singular or no number."""
    for k in range(n):
        best, row = abs(w[index(a + n * k + k)]), k
        for i in range(k + 1, n):
            if abs(w[index(a + n * i + k)]) > best:
                best, row = abs(w[index(a + n * i + k)]), i
        w[index(pivots + k)] = row
        if not 0.0 < best < 1e300:
            return False
        if row != k:
            exchange(w, a + n * k, a + n * row, n)
        inverse = 1.0 / w[index(a + n * k + k)]
        for i in range(k + 1, n):
            left = w[index(a + n * i + k)] * inverse
            w[index(a + n * i + k)] = left
            if left != 0.0:
                for j in range(k + 1, n):
                    w[index(a + n * i + j)] -= left * w[index(a + n * k + j)]
    return True


@kernel
def solve(w, a, pivots, n, b):
    """Solve in place for the right-hand side from place b."""
    for k in range(n):
        row = int(w[index(pivots + k)])
        w[index(b + k)], w[index(b + row)] = w[index(b + row)], w[index(b + k)]
    for i in range(n):
        total = w[index(b + i)]
        for j in range(i):
            total -= w[index(a + n * i + j)] * w[index(b + j)]
        w[index(b + i)] = total
    for i in range(n - 1, -1, -1):
        total = w[index(b + i)]
        for j in range(i + 1, n):
            total -= w[index(a + n * i + j)] * w[index(b + j)]
        w[index(b + i)] = total / w[index(a + n * i + i)]


@kernel
def factor_complex(w, a, pivots, n):
    """`factor` for a complex matrix: real part from place a, imaginary part n n further."""
    c = a + n * n
    for k in range(n):
        best, row = -1.0, k
        for i in range(k, n):
            x, y = w[index(a + n * i + k)], w[index(c + n * i + k)]
            if x * x + y * y > best:
                best, row = x * x + y * y, i
        w[index(pivots + k)] = row
        if not 0.0 < best < 1e300:
            return False
        if row != k:
            exchange(w, a + n * k, a + n * row, n)
            exchange(w, c + n * k, c + n * row, n)
        re, im = w[index(a + n * k + k)] / best, -w[index(c + n * k + k)] / best
        for i in range(k + 1, n):
            x, y = w[index(a + n * i + k)], w[index(c + n * i + k)]
            p, q = x * re - y * im, x * im + y * re
            w[index(a + n * i + k)], w[index(c + n * i + k)] = p, q
            if p != 0.0 or q != 0.0:
                for j in range(k + 1, n):
                    x, y = w[index(a + n * k + j)], w[index(c + n * k + j)]
                    w[index(a + n * i + j)] -= p * x - q * y
                    w[index(c + n * i + j)] -= p * y + q * x
    return True


@kernel
def solve_complex(w, a, pivots, n, b, d):
    """Solve in place for a right-hand side with its real part from place b, its imaginary part from d."""
    c = a + n * n
    for k in range(n):
        row = int(w[index(pivots + k)])
        w[index(b + k)], w[index(b + row)] = w[index(b + row)], w[index(b + k)]
        w[index(d + k)], w[index(d + row)] = w[index(d + row)], w[index(d + k)]
    for i in range(n):
        p, q = w[index(b + i)], w[index(d + i)]
        for j in range(i):
            x, y = w[index(a + n * i + j)], w[index(c + n * i + j)]
            p -= x * w[index(b + j)] - y * w[index(d + j)]
            q -= x * w[index(d + j)] + y * w[index(b + j)]
        w[index(b + i)], w[index(d + i)] = p, q
    for i in range(n - 1, -1, -1):
        p, q = w[index(b + i)], w[index(d + i)]
        for j in range(i + 1, n):
            x, y = w[index(a + n * i + j)], w[index(c + n * i + j)]
            p -= x * w[index(b + j)] - y * w[index(d + j)]
            q -= x * w[index(d + j)] + y * w[index(b + j)]
        x, y = w[index(a + n * i + i)], w[index(c + n * i + i)]
        size = x * x + y * y
        w[index(b + i)], w[index(d + i)] = (p * x + q * y) / size, (q * x - p * y) / size
