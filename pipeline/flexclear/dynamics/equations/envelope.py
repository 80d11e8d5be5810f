"""Cholesky factors in envelope form: row i is contiguous from its first nonzero column.

In the order "descendants before ancestors" the mass matrix of a tree has no fill outside this
envelope (Featherstone, *Rigid Body Dynamics Algorithms*, sec. 6.5), so that the cost follows the
branches of the mechanism. A matrix is stored in w from index `a`; its row table (first column, origin)
in h from index `e`. Functions process rows from `begin` to before `end`, with no column before `begin`: all, or a
diagonal block. The diagonal of a factor L has the reciprocals 1/L_ii, so that its application multiplies.

The innermost loops are while loops: `range` counts its turns as well, a sixth of their instructions.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.kernels import kernel


@kernel
def base(h, e, a, i):
    """Return the index in w of column 0 of row i (possibly before the row's first entry)."""
    return a + h[e + 2 * i + 1]


@kernel
def factor(h, e, w, a, begin, end, threshold):
    """Overwrite a symmetric matrix with its factor L, reciprocals on the diagonal; return True on success.

    It fails when a pivot is at most this fraction of its diagonal entry before elimination: the matrix is not positive
    definite to working precision.
    """
    sound = True
    for i in range(begin, end):
        first, row = h[e + 2 * i], base(h, e, a, i)
        pivot = w[row + i]
        least = threshold * pivot
        for j in range(first, i):
            other = base(h, e, a, j)
            total = w[row + j]
            k = max(first, h[e + 2 * j])
            while k < j:
                total -= w[row + k] * w[other + k]
                k += 1
            total *= w[other + j]
            w[row + j] = total
            pivot -= total * total
        sound = sound & (pivot > least)  # not so of NaN
        w[row + i] = 1.0 / np.sqrt(pivot)
    return sound


@kernel
def forward(h, e, w, a, begin, end, b):
    """Apply L^-1 to the vector in w from index b."""
    for i in range(begin, end):
        row = base(h, e, a, i)
        total = w[b + i]
        k = h[e + 2 * i]
        while k < i:
            total -= w[row + k] * w[b + k]
            k += 1
        w[b + i] = total * w[row + i]


@kernel
def backward(h, e, w, a, begin, end, b):
    """Apply L^-T to the vector in w from index b."""
    for i in range(end - 1, begin - 1, -1):
        row = base(h, e, a, i)
        value = w[b + i] * w[row + i]
        w[b + i] = value
        k = h[e + 2 * i]
        while k < i:
            w[b + k] -= w[row + k] * value
            k += 1
