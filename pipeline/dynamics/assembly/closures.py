r"""Loop closures: rows, Jacobian, and the multipliers that keep them closed.

A closure row is a wrench (moment about the world's origin, force); its Jacobian against a
coordinate is that wrench times the coordinate's column. With :math:`M = LL^T` the multipliers solve

.. math:: (J M^{-1} J^T)\lambda = \gamma - J M^{-1} f, \qquad
          M\dot v = f + J^T\lambda

with :math:`L^{-1}J^T` kept on the support of each closure (the coordinates on the way to the ground).

Rows that follow from others (planar loops in space, Bricard's loop) are not solved for: the kept
rows of a closure come first among its rows, the residuals of all are known (`assembly.selection`).
"""

from __future__ import annotations

from pipeline.dynamics.assembly.envelope import backward, base, factor, forward
from pipeline.dynamics.assembly.places import (
    CLOSURE_ENVELOPE,
    CLOSURE_PAIRS,
    CLOSURE_ROWS,
    COMMON,
    ENTRIES,
    GAMMA,
    JACOBIAN,
    KNOWN_ENTRIES,
    LAST_PIVOT,
    N_CLOSURE_PAIRS,
    N_KEPT_ROWS,
    N_KNOWN_ENTRIES,
    PIVOT,
    ROW_SCALE,
    SCHUR,
    SCHUR_SIZE,
    SPREAD,
    SUPPORT,
)
from pipeline.dynamics.tables import (
    ACCELERATION,
    ALPHA,
    AXES,
    DRIVE_FORCE,
    ENTRY0,
    ENVELOPE,
    EVALUATION,
    FORCE,
    JACOBIAN0,
    KEPT0,
    MASS,
    MULTIPLIER,
    N_CLOSURE_ROWS,
    N_CLOSURES,
    N_ENTRIES,
    N_KEPT,
    N_ROWS,
    N_SUPPORT,
    NV,
    OK,
    OMEGA,
    ORIGIN,
    RESIDUAL,
    RESIDUAL_RATE,
    ROW0,
    ROWS,
    SINGULAR,
    SITE_A,
    SITE_B,
    SUPPORT0,
    VELOCITY,
    closure,
    column,
    site_frame,
)
from pipeline.dynamics.vectors import add, at, at9, axis, cross, dot, dot6, kernel, put, scale, sub

#: pivots of J M^-1 J^T below this share of their diagonal mean a singular configuration
SINGULAR_PIVOT = 1e-13


@kernel
def rows(h, w, c):
    """Wrenches, residuals [m or -], their rates, and acceleration biases of closure c."""
    a, b = site_frame(h, closure(h, c, SITE_A)), site_frame(h, closure(h, c, SITE_B))
    A, B = at9(w, a + AXES), at9(w, b + AXES)
    omega_a, omega_b = at(w, a + OMEGA), at(w, b + OMEGA)
    p_b = at(w, b + ORIGIN)
    r = sub(p_b, at(w, a + ORIGIN))
    slide = sub(sub(at(w, b + VELOCITY), at(w, a + VELOCITY)), cross(omega_a, r))
    bias = sub(sub(at(w, b + ACCELERATION), at(w, a + ACCELERATION)), cross(at(w, a + ALPHA), r))
    bias = sub(bias, add(cross(omega_a, cross(omega_a, r)), scale(2.0, cross(omega_a, slide))))
    turning, turning_rate = sub(omega_b, omega_a), sub(at(w, b + ALPHA), at(w, a + ALPHA))
    first = closure(h, c, ROW0)
    for k in range(first, first + closure(h, c, N_ROWS)):
        o, declared = h[ROWS] + 6 * k, h[CLOSURE_ROWS] + 3 * k
        along = axis(A, h[declared + 1])
        if h[declared] == 0:
            put(w, o, cross(p_b, along))
            put(w, o + 3, along)
            w[h[RESIDUAL] + k] = dot(along, r)
            w[h[RESIDUAL_RATE] + k] = dot(along, slide)
            w[h[GAMMA] + k] = -dot(along, bias)
        else:
            against = axis(B, h[declared + 2])
            about = cross(against, along)
            swing = add(cross(cross(omega_b, against), along), cross(against, cross(omega_a, along)))
            put(w, o, about)
            put(w, o + 3, (0.0, 0.0, 0.0))
            w[h[RESIDUAL] + k] = dot(along, against)
            w[h[RESIDUAL_RATE] + k] = dot(turning, about)
            w[h[GAMMA] + k] = -dot(turning_rate, about) - dot(turning, swing)


@kernel
def jacobian(h, w, c):
    """J^T of closure c on its support: slot after slot, the rows of the closure side by side."""
    start, size, count = h[JACOBIAN] + closure(h, c, JACOBIAN0), closure(h, c, N_SUPPORT), closure(h, c, N_KEPT)
    for k in range(start, start + size * count):
        w[k] = 0.0
    first, wrenches = h[ENTRIES] + 3 * closure(h, c, ENTRY0), h[ROWS] + 6 * closure(h, c, ROW0)
    for e in range(first, first + 3 * closure(h, c, N_ENTRIES), 3):
        col, sign = column(h, h[e + 1]), float(h[e + 2])
        angular, linear = scale(sign, at(w, col)), scale(sign, at(w, col + 3))
        slot = start + count * h[e]
        for k in range(count):
            o = wrenches + 6 * k
            w[slot + k] += dot(angular, at(w, o)) + dot(linear, at(w, o + 3))


@kernel
def spread(h, w, c):
    """L^-1 J^T of closure c, laid out like J^T."""
    size, support, count = closure(h, c, N_SUPPORT), h[SUPPORT] + closure(h, c, SUPPORT0), closure(h, c, N_KEPT)
    J, S = h[JACOBIAN] + closure(h, c, JACOBIAN0), h[SPREAD] + closure(h, c, JACOBIAN0)
    for a in range(size):
        i = h[support + a]
        first, row, mine = h[h[ENVELOPE] + 2 * i], base(h, h[ENVELOPE], h[MASS], i), S + count * a
        for r in range(count):
            w[mine + r] = w[J + count * a + r]
        for b in range(a):
            k = h[support + b]
            if k >= first:
                l_ik, other = w[row + k], S + count * b
                for r in range(count):
                    w[mine + r] -= l_ik * w[other + r]
        inverse = 1.0 / w[row + i]
        for r in range(count):
            w[mine + r] *= inverse


@kernel
def couple(h, w, p):
    """The block of J M^-1 J^T between the closures of pair p, added to zeros."""
    o = h[CLOSURE_PAIRS] + 4 * p
    a, b, common = h[o], h[o + 1], h[COMMON] + 2 * h[o + 2]
    A, B = h[SPREAD] + closure(h, a, JACOBIAN0), h[SPREAD] + closure(h, b, JACOBIAN0)
    rows_a, rows_b = closure(h, a, N_KEPT), closure(h, b, N_KEPT)
    row0, col0 = closure(h, b, KEPT0), closure(h, a, KEPT0)
    for k in range(common, common + 2 * h[o + 3], 2):
        left, right = A + rows_a * h[k], B + rows_b * h[k + 1]
        for r in range(rows_b):
            value, row = w[right + r], base(h, h[CLOSURE_ENVELOPE], h[SCHUR], row0 + r) + col0
            for s in range(r + 1 if a == b else rows_a):
                w[row + s] += value * w[left + s]


@kernel
def prepare(h, w, n):
    """Rows, Jacobians and the factor of J M^-1 J^T; needs the factor of M."""
    for c in range(h[N_CLOSURES]):
        rows(h, w, c)
        jacobian(h, w, c)
        spread(h, w, c)
    for k in range(h[SCHUR], h[SCHUR] + h[SCHUR_SIZE]):
        w[k] = 0.0
    for p in range(h[N_CLOSURE_PAIRS]):
        couple(h, w, p)
    for r in range(h[N_KEPT_ROWS]):
        size = w[base(h, h[CLOSURE_ENVELOPE], h[SCHUR], r) + r]
        w[h[ROW_SCALE] + h[N_CLOSURE_ROWS] + r] = size
    ratio = factor(h, h[CLOSURE_ENVELOPE], w, h[SCHUR], h[N_KEPT_ROWS], SINGULAR_PIVOT)
    pivot = independence(h, w) if ratio > SINGULAR_PIVOT else 0.0
    w[h[PIVOT] + LAST_PIVOT] = pivot
    n[EVALUATION] = OK if pivot > SINGULAR_PIVOT else SINGULAR


@kernel
def independence(h, w):
    """Smallest pivot of J M^-1 J^T as share of the largest that its row's diagonal entry has been on the way."""
    least = 1.0
    for r in range(h[N_KEPT_ROWS]):
        pivot = w[base(h, h[CLOSURE_ENVELOPE], h[SCHUR], r) + r] ** 2
        o = h[ROW_SCALE] + r
        least = min(least, pivot / max(w[o], w[o + h[N_CLOSURE_ROWS]]))
    return least


@kernel
def add_spread(h, w, y, weight):
    """Y <- y + weight L^-1 J^T lambda, y in w."""
    for c in range(h[N_CLOSURES]):
        count, support = closure(h, c, N_KEPT), h[SUPPORT] + closure(h, c, SUPPORT0)
        S, first = h[SPREAD] + closure(h, c, JACOBIAN0), h[MULTIPLIER] + closure(h, c, KEPT0)
        for a in range(closure(h, c, N_SUPPORT)):
            total = 0.0
            for r in range(count):
                total += w[S + count * a + r] * w[first + r]
            w[y + h[support + a]] += weight * total


@kernel
def gather_rows(h, w, values):
    """The kept ones of the rows' values from w[values] on, as a right-hand side for the multipliers."""
    for c in range(h[N_CLOSURES]):
        row, kept = values + closure(h, c, ROW0), h[MULTIPLIER] + closure(h, c, KEPT0)
        for k in range(closure(h, c, N_KEPT)):
            w[kept + k] = w[row + k]


@kernel
def solve(h, w):
    """Multipliers from their right-hand side, in place."""
    forward(h, h[CLOSURE_ENVELOPE], w, h[SCHUR], h[N_KEPT_ROWS], h[MULTIPLIER])
    backward(h, h[CLOSURE_ENVELOPE], w, h[SCHUR], h[N_KEPT_ROWS], h[MULTIPLIER])


@kernel
def close(h, w, n):
    """Multipliers, and FORCE (holding L^-1 f) completed by them: L^-T then gives the accelerations."""
    prepare(h, w, n)
    if n[EVALUATION] != OK:
        return
    gather_rows(h, w, h[GAMMA])
    for c in range(h[N_CLOSURES]):
        count, support = closure(h, c, N_KEPT), h[SUPPORT] + closure(h, c, SUPPORT0)
        S, first = h[SPREAD] + closure(h, c, JACOBIAN0), h[MULTIPLIER] + closure(h, c, KEPT0)
        for a in range(closure(h, c, N_SUPPORT)):
            force = w[h[FORCE] + h[support + a]]
            for r in range(count):
                w[first + r] -= w[S + count * a + r] * force
    solve(h, w)
    add_spread(h, w, h[FORCE], 1.0)


@kernel
def known_forces(h, w):
    """Take the closures' share out of the forces that the drives must supply."""
    for e in range(h[N_KNOWN_ENTRIES]):
        o = h[KNOWN_ENTRIES] + 4 * e
        c, d, col, sign = h[o], h[o + 1], column(h, h[o + 2]), h[o + 3]
        wrenches, first = h[ROWS] + 6 * closure(h, c, ROW0), h[MULTIPLIER] + closure(h, c, KEPT0)
        for k in range(closure(h, c, N_KEPT)):
            w[h[DRIVE_FORCE] + d] -= sign * dot6(w, wrenches + 6 * k, w, col) * w[first + k]


@kernel
def correction(h, w, residual, step):
    """The least correction of the coordinates, in the metric of M, that undoes a residual.

    step <- -M^-1 J^T (J M^-1 J^T)^-1 residual, both places in w, with the factors of `prepare`.
    """
    gather_rows(h, w, residual)
    solve(h, w)
    for k in range(h[NV]):
        w[step + k] = 0.0
    add_spread(h, w, step, -1.0)
    backward(h, h[ENVELOPE], w, h[MASS], h[NV], step)
