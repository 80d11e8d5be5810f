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

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.envelope import backward, base, factor, forward
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import add, at, at9, axis, cross, dot, dot6, put, scale, sub

#: pivots of J M^-1 J^T below this share of their diagonal mean a singular configuration
SINGULAR_PIVOT = 1e-13


@kernel
def rows(h, w, c):
    """Wrenches, residuals [m or -], their rates, and acceleration biases of closure c."""
    a, b = m.SITE_FRAMES.row(h, m.CLOSURES.site_a(h, c)), m.SITE_FRAMES.row(h, m.CLOSURES.site_b(h, c))
    A, B = at9(w, a + m.FRAME.axes), at9(w, b + m.FRAME.axes)
    omega_a, omega_b = at(w, a + m.FRAME.omega), at(w, b + m.FRAME.omega)
    p_b = at(w, b + m.FRAME.origin)
    r = sub(p_b, at(w, a + m.FRAME.origin))
    slide = sub(sub(at(w, b + m.FRAME.velocity), at(w, a + m.FRAME.velocity)), cross(omega_a, r))
    bias = sub(
        sub(at(w, b + m.FRAME.acceleration), at(w, a + m.FRAME.acceleration)), cross(at(w, a + m.FRAME.alpha), r)
    )
    bias = sub(bias, add(cross(omega_a, cross(omega_a, r)), scale(2.0, cross(omega_a, slide))))
    turning, turning_rate = sub(omega_b, omega_a), sub(at(w, b + m.FRAME.alpha), at(w, a + m.FRAME.alpha))
    first = m.CLOSURES.row0(h, c)
    for k in range(first, first + m.CLOSURES.n_rows(h, c)):
        o, along = m.ROWS.row(h, k), axis(A, m.CLOSURE_ROWS.a(h, k))
        if m.CLOSURE_ROWS.kind(h, k) == 0:
            put(w, o, cross(p_b, along))
            put(w, o + 3, along)
            w[h[m.RESIDUAL] + k] = dot(along, r)
            w[h[m.RESIDUAL_RATE] + k] = dot(along, slide)
            w[h[m.GAMMA] + k] = -dot(along, bias)
        else:
            against = axis(B, m.CLOSURE_ROWS.b(h, k))
            about = cross(against, along)
            swing = add(cross(cross(omega_b, against), along), cross(against, cross(omega_a, along)))
            put(w, o, about)
            put(w, o + 3, (0.0, 0.0, 0.0))
            w[h[m.RESIDUAL] + k] = dot(along, against)
            w[h[m.RESIDUAL_RATE] + k] = dot(turning, about)
            w[h[m.GAMMA] + k] = -dot(turning_rate, about) - dot(turning, swing)


@kernel
def jacobian(h, w, c):
    """J^T of closure c on its support: slot after slot, the rows of the closure side by side."""
    start, size, count = h[m.JACOBIAN] + m.CLOSURES.jacobian0(h, c), m.CLOSURES.n_support(h, c), m.CLOSURES.n_kept(h, c)
    for k in range(start, start + size * count):
        w[k] = 0.0
    first, wrenches = m.CLOSURES.entry0(h, c), m.ROWS.row(h, m.CLOSURES.row0(h, c))
    for e in range(first, first + m.CLOSURES.n_entries(h, c)):
        col, sign = m.COLUMNS.row(h, m.ENTRIES.column(h, e)), float(m.ENTRIES.sign(h, e))
        angular, linear = scale(sign, at(w, col)), scale(sign, at(w, col + 3))
        slot = start + count * m.ENTRIES.slot(h, e)
        for k in range(count):
            o = wrenches + 6 * k
            w[slot + k] += dot(angular, at(w, o)) + dot(linear, at(w, o + 3))


@kernel
def spread(h, w, c):
    """L^-1 J^T of closure c, laid out like J^T."""
    size, support, count = m.CLOSURES.n_support(h, c), m.CLOSURES.support0(h, c), m.CLOSURES.n_kept(h, c)
    J, S = h[m.JACOBIAN] + m.CLOSURES.jacobian0(h, c), h[m.SPREAD] + m.CLOSURES.jacobian0(h, c)
    for a in range(size):
        i = m.SUPPORT.coordinate(h, support + a)
        first, row, mine = m.ENVELOPE.first(h, i), base(h, h[m.ENVELOPE.place], h[m.MASS], i), S + count * a
        for r in range(count):
            w[mine + r] = w[J + count * a + r]
        for b in range(a - 1, -1, -1):
            k = m.SUPPORT.coordinate(h, support + b)
            if k < first:
                break  # in increasing order
            l_ik, other = w[row + k], S + count * b
            for r in range(count):
                w[mine + r] -= l_ik * w[other + r]
        inverse = w[row + i]
        for r in range(count):
            w[mine + r] *= inverse


@kernel
def couple(h, w, p):
    """The block of J M^-1 J^T between the closures of pair p, added to zeros."""
    a, b, common = m.CLOSURE_PAIRS.a(h, p), m.CLOSURE_PAIRS.b(h, p), m.CLOSURE_PAIRS.common0(h, p)
    A, B = h[m.SPREAD] + m.CLOSURES.jacobian0(h, a), h[m.SPREAD] + m.CLOSURES.jacobian0(h, b)
    rows_a, rows_b = m.CLOSURES.n_kept(h, a), m.CLOSURES.n_kept(h, b)
    row0, col0 = m.CLOSURES.kept0(h, b), m.CLOSURES.kept0(h, a)
    for k in range(common, common + m.CLOSURE_PAIRS.n_common(h, p)):
        left, right = A + rows_a * m.COMMON.a(h, k), B + rows_b * m.COMMON.b(h, k)
        for r in range(rows_b):
            value, row = w[right + r], base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], row0 + r) + col0
            for s in range(r + 1 if a == b else rows_a):
                w[row + s] += value * w[left + s]


@kernel
def complete(h, w, n):
    """The factor of J M^-1 J^T, of Jacobians that are there; needs the factor of M."""
    for c in range(h[m.N_CLOSURES]):
        spread(h, w, c)
    for k in range(h[m.SCHUR], h[m.SCHUR] + h[m.SCHUR_SIZE]):
        w[k] = 0.0
    for p in range(h[m.N_CLOSURE_PAIRS]):
        couple(h, w, p)
    for r in range(h[m.N_KEPT_ROWS]):
        size = w[base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], r) + r]
        w[h[m.ROW_SCALE] + h[m.N_CLOSURE_ROWS] + r] = size
    ratio = factor(h, h[m.CLOSURE_ENVELOPE.place], w, h[m.SCHUR], h[m.N_KEPT_ROWS], SINGULAR_PIVOT)
    pivot = independence(h, w) if ratio > SINGULAR_PIVOT else 0.0
    w[h[m.PIVOT] + m.LAST_PIVOT] = pivot
    n[m.EVALUATION] = m.OK if pivot > SINGULAR_PIVOT else m.SINGULAR


@kernel
def independence(h, w):
    """Smallest pivot of J M^-1 J^T as share of the largest that its row's diagonal entry has been on the way."""
    least = 1.0
    for r in range(h[m.N_KEPT_ROWS]):
        inverse = w[base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], r) + r]
        pivot = 1.0 / (inverse * inverse)
        o = h[m.ROW_SCALE] + r
        least = min(least, pivot / max(w[o], w[o + h[m.N_CLOSURE_ROWS]]))
    return least


@kernel
def add_spread(h, w, y, weight):
    """Y <- y + weight L^-1 J^T lambda, y in w."""
    for c in range(h[m.N_CLOSURES]):
        count, support = m.CLOSURES.n_kept(h, c), m.CLOSURES.support0(h, c)
        S, first = h[m.SPREAD] + m.CLOSURES.jacobian0(h, c), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
        for a in range(m.CLOSURES.n_support(h, c)):
            total = 0.0
            for r in range(count):
                total += w[S + count * a + r] * w[first + r]
            w[y + m.SUPPORT.coordinate(h, support + a)] += weight * total


@kernel
def gather_rows(h, w, values):
    """The kept ones of the rows' values from w[values] on, as a right-hand side for the multipliers."""
    for c in range(h[m.N_CLOSURES]):
        row, kept = values + m.CLOSURES.row0(h, c), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
        for k in range(m.CLOSURES.n_kept(h, c)):
            w[kept + k] = w[row + k]


@kernel
def solve(h, w):
    """Multipliers from their right-hand side, in place."""
    forward(h, h[m.CLOSURE_ENVELOPE.place], w, h[m.SCHUR], h[m.N_KEPT_ROWS], h[m.MULTIPLIER])
    backward(h, h[m.CLOSURE_ENVELOPE.place], w, h[m.SCHUR], h[m.N_KEPT_ROWS], h[m.MULTIPLIER])


@kernel
def respond(h, w):
    """Multipliers of what is asked of the rows (there, in place) and of FORCE, which holds L^-1 f and is completed by
    them: L^-T then gives the accelerations."""
    for c in range(h[m.N_CLOSURES]):
        count, support = m.CLOSURES.n_kept(h, c), m.CLOSURES.support0(h, c)
        S, first = h[m.SPREAD] + m.CLOSURES.jacobian0(h, c), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
        for a in range(m.CLOSURES.n_support(h, c)):
            force = w[h[m.FORCE] + m.SUPPORT.coordinate(h, support + a)]
            for r in range(count):
                w[first + r] -= w[S + count * a + r] * force
    solve(h, w)
    add_spread(h, w, h[m.FORCE], 1.0)


@kernel
def finish(h, w):
    """Multipliers of the rows' biases and of FORCE; see `respond`."""
    gather_rows(h, w, h[m.GAMMA])
    respond(h, w)


@kernel
def close(h, f, w, n):
    """Rows, Jacobians and multipliers of all closures; see `finish`."""
    for c in range(h[m.N_CLOSURES]):
        rows(h, w, c)
        jacobian(h, w, c)
    complete(h, w, n)
    if n[m.EVALUATION] == m.OK:
        finish(h, w)


@kernel
def take_share(h, w, e, wrenches):
    """Take what a closure's multipliers do along one known column (entry e) out of its drive's force.

    wrenches: place of those of the closure's kept rows in w.
    """
    c, d, sign = m.KNOWN_ENTRIES.closure(h, e), m.KNOWN_ENTRIES.drive(h, e), m.KNOWN_ENTRIES.sign(h, e)
    col, first = m.COLUMNS.row(h, m.KNOWN_ENTRIES.column(h, e)), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
    for k in range(m.CLOSURES.n_kept(h, c)):
        w[h[m.DRIVE_FORCE] + d] -= sign * dot6(w, wrenches + 6 * k, w, col) * w[first + k]


@kernel
def known_forces(h, w):
    """Take the closures' share out of the forces that the drives must supply."""
    for e in range(h[m.N_KNOWN_ENTRIES]):
        take_share(h, w, e, m.ROWS.row(h, m.CLOSURES.row0(h, m.KNOWN_ENTRIES.closure(h, e))))


@kernel
def correction(h, w, residual, step):
    """The least correction of the coordinates, in the metric of M, that undoes a residual.

    step <- -M^-1 J^T (J M^-1 J^T)^-1 residual, both places in w, with the factors of `complete`.
    """
    gather_rows(h, w, residual)
    solve(h, w)
    for k in range(h[m.NV]):
        w[step + k] = 0.0
    add_spread(h, w, step, -1.0)
    backward(h, h[m.ENVELOPE.place], w, h[m.MASS], h[m.NV], step)
