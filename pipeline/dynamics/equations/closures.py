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

from collections.abc import Callable
from typing import Any, NamedTuple

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.envelope import backward, base, factor, forward
from flexclear.pipeline.dynamics.fields import data
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, accumulate, add, at, at9, axis, cross, dot, dot6, put, scale, sub

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
def at_some(w, i, count):
    """The first `count` entries of a vector stored from place i, zeros for those that are not there."""
    return (w[i], w[i + 1] if count > 1 else 0.0, w[i + 2] if count > 2 else 0.0)


@kernel
def put_some(w, i, v, count):
    """Store the first `count` entries of a vector from place i."""
    w[i] = v[0]
    if count > 1:
        w[i + 1] = v[1]
    if count > 2:
        w[i + 2] = v[2]


@kernel
def three(h, stored, c, t):
    """Where JACOBIAN or SPREAD (`stored`) keeps the t-th three rows of closure c: slot after slot, side by side."""
    return h[stored] + m.CLOSURES.jacobian0(h, c) + 3 * t * m.CLOSURES.n_support(h, c)


@kernel
def jacobian(h, w, c):
    """J^T of closure c on its support."""
    count, wrenches, first = m.CLOSURES.n_kept(h, c), m.ROWS.row(h, m.CLOSURES.row0(h, c)), m.CLOSURES.entry0(h, c)
    for t in range(m.CLOSURES.threes(h, c)):
        start, o, second, third = three(h, m.JACOBIAN, c, t), wrenches + 18 * t, 3 * t + 1 < count, 3 * t + 2 < count
        for k in range(start, start + 3 * m.CLOSURES.n_support(h, c)):
            w[k] = 0.0
        moment0, force0 = at(w, o), at(w, o + 3)
        moment1, force1 = at(w, o + 6) if second else ZERO, at(w, o + 9) if second else ZERO
        moment2, force2 = at(w, o + 12) if third else ZERO, at(w, o + 15) if third else ZERO
        for e in range(first, first + m.CLOSURES.n_entries(h, c)):
            col, sign = m.COLUMNS.row(h, m.ENTRIES.column(h, e)), float(m.ENTRIES.sign(h, e))
            angular, linear = at(w, col), at(w, col + 3)
            share = (
                dot(moment0, angular) + dot(force0, linear),
                dot(moment1, angular) + dot(force1, linear),
                dot(moment2, angular) + dot(force2, linear),
            )
            accumulate(w, start + 3 * m.ENTRIES.slot(h, e), scale(sign, share))


@kernel
def put_couplings(h, w, row, column, values, count):
    """The first `count` of three entries of J M^-1 J^T."""
    put_some(w, base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], row) + column, values, count)


@kernel
def couple(h, w, p):
    """The block of J M^-1 J^T between the closures of pair p, three by three entries after the other."""
    a, b, common = m.CLOSURE_PAIRS.a(h, p), m.CLOSURE_PAIRS.b(h, p), m.CLOSURE_PAIRS.common0(h, p)
    for t in range(m.CLOSURES.threes(h, b)):
        right = three(h, m.SPREAD, b, t)
        row, rows = m.CLOSURES.kept0(h, b) + 3 * t, m.CLOSURES.n_kept(h, b) - 3 * t
        for u in range(t + 1 if a == b else m.CLOSURES.threes(h, a)):
            left, first, second, third = three(h, m.SPREAD, a, u), ZERO, ZERO, ZERO
            for k in range(common, common + m.CLOSURE_PAIRS.n_common(h, p)):
                values, factors = at(w, left + 3 * m.COMMON.a(h, k)), at(w, right + 3 * m.COMMON.b(h, k))
                first = add(first, scale(factors[0], values))
                second = add(second, scale(factors[1], values))
                third = add(third, scale(factors[2], values))
            column, columns, diagonal = (
                m.CLOSURES.kept0(h, a) + 3 * u,
                m.CLOSURES.n_kept(h, a) - 3 * u,
                a == b and t == u,
            )
            put_couplings(h, w, row, column, first, 1 if diagonal else columns)
            if rows > 1:
                put_couplings(h, w, row + 1, column, second, 2 if diagonal else columns)
            if rows > 2:
                put_couplings(h, w, row + 2, column, third, 3 if diagonal else columns)


@kernel
def couple_all(h, w, n):
    """The factor of J M^-1 J^T, from L^-1 J^T."""
    for k in range(h[m.SCHUR], h[m.SCHUR] + h[m.SCHUR_SIZE]):
        w[k] = 0.0
    for p in range(h[m.N_CLOSURE_PAIRS]):
        couple(h, w, p)
    for r in range(h[m.N_KEPT_ROWS]):
        size = w[base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], r) + r]
        w[h[m.ROW_SCALE] + h[m.N_CLOSURE_ROWS] + r] = size
    sound = factor(h, h[m.CLOSURE_ENVELOPE.place], w, h[m.SCHUR], h[m.N_KEPT_ROWS], SINGULAR_PIVOT)
    pivot = independence(h, w) if sound else 0.0
    w[h[m.PIVOT] + m.LAST_PIVOT] = pivot
    n[m.EVALUATION] = m.OK if pivot > SINGULAR_PIVOT else m.SINGULAR


@kernel
def independence(h, w):
    """Smallest pivot of J M^-1 J^T as share of the largest that its row's diagonal entry has been on the way."""
    most = 1.0
    for r in range(h[m.N_KEPT_ROWS]):
        inverse = w[base(h, h[m.CLOSURE_ENVELOPE.place], h[m.SCHUR], r) + r]
        o = h[m.ROW_SCALE] + r
        most = max(most, inverse * inverse * max(w[o], w[o + h[m.N_CLOSURE_ROWS]]))
    return 1.0 / most


@kernel
def add_spread(h, w, y, weight):
    """Y <- y + weight L^-1 J^T lambda, y in w."""
    for c in range(h[m.N_CLOSURES]):
        support, first = m.CLOSURES.support0(h, c), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
        for t in range(m.CLOSURES.threes(h, c)):
            S, forces = three(h, m.SPREAD, c, t), at_some(w, first + 3 * t, m.CLOSURES.n_kept(h, c) - 3 * t)
            forces = scale(weight, forces)
            for a in range(m.CLOSURES.n_support(h, c)):
                w[y + m.SUPPORT.coordinate(h, support + a)] += dot(forces, at(w, S + 3 * a))


@kernel
def take_spread(h, w, y):
    """Lambda <- lambda - (L^-1 J^T)^T y, y in w."""
    for c in range(h[m.N_CLOSURES]):
        support, first = m.CLOSURES.support0(h, c), h[m.MULTIPLIER] + m.CLOSURES.kept0(h, c)
        for t in range(m.CLOSURES.threes(h, c)):
            S, count = three(h, m.SPREAD, c, t), m.CLOSURES.n_kept(h, c) - 3 * t
            total = at_some(w, first + 3 * t, count)
            for a in range(m.CLOSURES.n_support(h, c)):
                total = sub(total, scale(w[y + m.SUPPORT.coordinate(h, support + a)], at(w, S + 3 * a)))
            put_some(w, first + 3 * t, total, count)


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
    take_spread(h, w, h[m.FORCE])
    solve(h, w)
    add_spread(h, w, h[m.FORCE], 1.0)


@kernel
def finish(h, w):
    """Multipliers of the rows' biases and of FORCE; see `respond`."""
    gather_rows(h, w, h[m.GAMMA])
    respond(h, w)


@kernel
def locate(h, f, w):
    """Rows and Jacobians of all closures."""
    for c in range(h[m.N_CLOSURES]):
        rows(h, w, c)
        jacobian(h, w, c)


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


class Closing(NamedTuple):
    """Kernels of all closures.

    close(h, f, w, n): rows, Jacobians and multipliers, see `finish`.  complete(h, f, w, n): the factor of J M^-1 J^T,
    of Jacobians that are there; needs the factor of M.  correction(h, f, w, n, residual, step): step <-
    -M^-1 J^T (J M^-1 J^T)^-1 residual, both indices in w, with the factors of `complete`: the least correction of the
    coordinates, in the metric of M, that undoes a residual.  known_forces(h, w): takes the closures' fraction out of
    the forces that the drives must supply.
    """

    close: Callable
    complete: Callable
    correction: Callable
    known_forces: Callable


def make_closing(tree: Any, locate: Callable = locate, known_forces: Callable = known_forces) -> Closing:
    """Return the kernels of all closures.

    tree: what factors the mass matrix, the module `articulated` or `composite`.  locate: fills rows and Jacobians.
    """
    spread, backward = tree.spread, tree.backward

    @kernel
    def complete(h, f, w, n):
        d = data(h, f, w, n)
        for c in range(d.n_closures):
            spread(d, c)
        couple_all(h, w, n)

    @kernel
    def close(h, f, w, n):
        locate(h, f, w)
        complete(h, f, w, n)
        if n[m.EVALUATION] == m.OK:
            finish(h, w)

    @kernel
    def correction(h, f, w, n, residual, step):
        gather_rows(h, w, residual)
        solve(h, w)
        for k in range(h[m.NV]):
            w[step + k] = 0.0
        add_spread(h, w, step, -1.0)
        backward(data(h, f, w, n), step)

    return Closing(close, complete, correction, known_forces)
