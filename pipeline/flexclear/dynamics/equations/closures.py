r"""Loop closures: rows, Jacobian and multipliers.

A closure row is a wrench (moment about the world's origin, force); its Jacobian against a
coordinate is that wrench times the coordinate's column. With :math:`M = LL^T` the multipliers solve

.. math:: (J M^{-1} J^T)\lambda = \gamma - J M^{-1} f, \qquad
          M\dot v = f + J^T\lambda

with :math:`L^{-1}J^T` stored on the support of each closure (the coordinates on its paths to the ground).

Rows that follow from others (planar loops in space, Bricard's loop) are redundant. The selected rows of a closure come
first among its rows; the residuals of all rows are computed (`model.selection`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.envelope import backward, factor, forward
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, accumulate, add, at, axis, cross, dot, dot_wrench, scale, sub

#: pivots of J M^-1 J^T below this fraction of their diagonal entry indicate a singular configuration
SINGULAR_PIVOT = 1e-13


@kernel
def rows(d, c):
    """Compute wrenches, residuals [m or -], rates and biases of closure c; Wang & Wang (2019), eqs. (30), (31)."""
    closure = d.closures[c]
    a, b = d.site_frames[closure.site_a], d.site_frames[closure.site_b]
    A, B, omega_a, omega_b, p_b = a.axes, b.axes, a.omega, b.omega, b.origin
    r = sub(p_b, a.origin)
    slide = sub(sub(b.velocity, a.velocity), cross(omega_a, r))
    bias = sub(sub(b.acceleration, a.acceleration), cross(a.alpha, r))
    bias = sub(bias, add(cross(omega_a, cross(omega_a, r)), scale(2.0, cross(omega_a, slide))))
    turning, turning_rate = sub(omega_b, omega_a), sub(b.alpha, a.alpha)
    for k in range(closure.row0, closure.row0 + closure.n_rows):
        row, wrench = d.closure_rows[k], d.rows[k]
        along = axis(A, row.a)
        if row.kind == 0:
            wrench.moment, wrench.force = cross(p_b, along), along
            d.residual[k] = dot(along, r)
            d.residual_rate[k] = dot(along, slide)
            d.gamma[k] = -dot(along, bias)
        else:
            against = axis(B, row.b)
            about = cross(against, along)
            swing = add(cross(cross(omega_b, against), along), cross(against, cross(omega_a, along)))
            wrench.moment, wrench.force = about, ZERO
            d.residual[k] = dot(along, against)
            d.residual_rate[k] = dot(turning, about)
            d.gamma[k] = -dot(turning_rate, about) - dot(turning, swing)


@kernel
def at_some(a, i, count):
    """Return the first `count` entries of a vector stored from index i, padded with zeros."""
    return (a[i], a[i + 1] if count > 1 else 0.0, a[i + 2] if count > 2 else 0.0)


@kernel
def put_some(a, i, v, count):
    """Store the first `count` entries of a vector from index i."""
    a[i] = v[0]
    if count > 1:
        a[i + 1] = v[1]
    if count > 2:
        a[i + 2] = v[2]


@kernel
def three(closure, t):
    """Return the index in JACOBIAN or SPREAD of the t-th three rows of a closure, stored slot after slot."""
    return closure.jacobian0 + 3 * t * closure.n_support


@kernel
def jacobian(d, c):
    """Compute J^T of closure c on its support."""
    closure = d.closures[c]
    for t in range(closure.threes):
        start, k = three(closure, t), closure.row0 + 3 * t
        second, third = 3 * t + 1 < closure.n_kept, 3 * t + 2 < closure.n_kept
        for e in range(start, start + 3 * closure.n_support):
            d.jacobian[e] = 0.0
        moment0, force0 = d.rows[k].moment, d.rows[k].force
        moment1, force1 = d.rows[k + 1].moment if second else ZERO, d.rows[k + 1].force if second else ZERO
        moment2, force2 = d.rows[k + 2].moment if third else ZERO, d.rows[k + 2].force if third else ZERO
        for e in range(closure.entry0, closure.entry0 + closure.n_entries):
            entry = d.entries[e]
            column = d.columns[entry.column]
            share = (
                dot(moment0, column.angular) + dot(force0, column.linear),
                dot(moment1, column.angular) + dot(force1, column.linear),
                dot(moment2, column.angular) + dot(force2, column.linear),
            )
            accumulate(d.jacobian, start + 3 * entry.slot, scale(float(entry.sign), share))


@kernel
def put_couplings(d, row, column, values, count):
    """Store the first `count` of three entries of J M^-1 J^T."""
    put_some(d.schur, d.closure_envelope[row].origin + column, values, count)


@kernel
def couple(d, p):
    """Compute the block of J M^-1 J^T between the closures of pair p, by blocks of three by three."""
    pair = d.closure_pairs[p]
    a, b = d.closures[pair.a], d.closures[pair.b]
    for t in range(b.threes):
        right, row, rows = three(b, t), b.kept0 + 3 * t, b.n_kept - 3 * t
        for u in range(t + 1 if pair.a == pair.b else a.threes):
            left, first, second, third = three(a, u), ZERO, ZERO, ZERO
            for k in range(pair.common0, pair.common0 + pair.n_common):
                slots = d.common[k]
                values, factors = at(d.spread, left + 3 * slots.a), at(d.spread, right + 3 * slots.b)
                first = add(first, scale(factors[0], values))
                second = add(second, scale(factors[1], values))
                third = add(third, scale(factors[2], values))
            column, columns, diagonal = a.kept0 + 3 * u, a.n_kept - 3 * u, pair.a == pair.b and t == u
            put_couplings(d, row, column, first, 1 if diagonal else columns)
            if rows > 1:
                put_couplings(d, row + 1, column, second, 2 if diagonal else columns)
            if rows > 2:
                put_couplings(d, row + 2, column, third, 3 if diagonal else columns)


@kernel
def couple_all(d):
    """Factorise J M^-1 J^T, from L^-1 J^T."""
    for k in range(d.schur_size):
        d.schur[k] = 0.0
    for p in range(d.n_closure_pairs):
        couple(d, p)
    for r in range(d.n_kept_rows):
        d.row_scale[d.n_closure_rows + r] = d.schur[d.closure_envelope[r].origin + r]
    sound = factor(d.h, d.at_closure_envelope, d.w, d.at_schur, 0, d.n_kept_rows, SINGULAR_PIVOT)
    pivot = independence(d) if sound else 0.0
    d.last_pivot = pivot
    d.evaluation = m.OK if pivot > SINGULAR_PIVOT else m.SINGULAR


@kernel
def independence(d):
    """Return the smallest pivot of J M^-1 J^T over its row's largest diagonal entry during the elimination."""
    most = 1.0
    for r in range(d.n_kept_rows):
        inverse = d.schur[d.closure_envelope[r].origin + r]
        most = max(most, inverse * inverse * max(d.row_scale[r], d.row_scale[d.n_closure_rows + r]))
    return 1.0 / most


@kernel
def add_spread(d, y):
    """Add L^-1 J^T lambda to y in w."""
    for c in range(d.n_closures):
        closure = d.closures[c]
        for t in range(closure.threes):
            start = three(closure, t)
            forces = at_some(d.multiplier, closure.kept0 + 3 * t, closure.n_kept - 3 * t)
            for a in range(closure.n_support):
                k = d.support[closure.support0 + a].coordinate
                d.w[y + k] += dot(forces, at(d.spread, start + 3 * a))


@kernel
def take_spread(d, y):
    """Subtract (L^-1 J^T)^T y from lambda, y in w."""
    for c in range(d.n_closures):
        closure = d.closures[c]
        for t in range(closure.threes):
            start, first, count = three(closure, t), closure.kept0 + 3 * t, closure.n_kept - 3 * t
            total = at_some(d.multiplier, first, count)
            for a in range(closure.n_support):
                k = d.support[closure.support0 + a].coordinate
                total = sub(total, scale(d.w[y + k], at(d.spread, start + 3 * a)))
            put_some(d.multiplier, first, total, count)


@kernel
def gather_rows(d):
    """Copy the selected rows' biases to the right-hand side of the multipliers."""
    for c in range(d.n_closures):
        closure = d.closures[c]
        for k in range(closure.n_kept):
            d.multiplier[closure.kept0 + k] = d.gamma[closure.row0 + k]


@kernel
def solve(d):
    """Solve for the multipliers in place of their right-hand side."""
    forward(d.h, d.at_closure_envelope, d.w, d.at_schur, 0, d.n_kept_rows, d.at_multiplier)
    backward(d.h, d.at_closure_envelope, d.w, d.at_schur, 0, d.n_kept_rows, d.at_multiplier)


@kernel
def respond(d):
    """Solve for the multipliers in place of the rows' required rates; FORCE, which has L^-1 f, gets their part, so that
    L^-T gives the accelerations."""
    take_spread(d, d.at_force)
    solve(d)
    add_spread(d, d.at_force)


@kernel
def finish(d):
    """Solve for the multipliers of the rows' biases and of FORCE; see `respond`."""
    gather_rows(d)
    respond(d)


@kernel
def locate(d):
    """Compute rows and Jacobians of all closures."""
    for c in range(d.n_closures):
        rows(d, c)
        jacobian(d, c)


@kernel
def wrench_row(d, c, part):
    """Return the first row of ROWS of closure c; of a coupling that of its second joint, or of its first (part 1)."""
    return d.closures[c].row0 if part == 0 else d.n_closure_rows + d.closures[c].coupling


@kernel
def closure_wrench(d, c, part):
    """Return the wrench of closure c on its second body, or of a coupling on its first joint (part 1)."""
    closure, moment, force, first = d.closures[c], ZERO, ZERO, wrench_row(d, c, part)
    for k in range(closure.n_kept):
        size, row = d.multiplier[closure.kept0 + k], d.rows[first + k]
        moment, force = add(moment, scale(size, row.moment)), add(force, scale(size, row.force))
    return moment, force


@kernel
def known_forces(d):
    """Subtract the closures' forces along prescribed coordinates from the forces that the drives must supply."""
    for e in range(d.n_known_entries):
        known = d.known_entries[e]
        closure, column = d.closures[known.closure], d.columns[known.column]
        first = wrench_row(d, known.closure, known.part)
        for k in range(closure.n_kept):
            wrench, size = d.rows[first + k], d.multiplier[closure.kept0 + k]
            d.drive_force[known.drive] -= known.sign * dot_wrench(wrench, column) * size


class Closing(NamedTuple):
    """Kernels of all closures.

    close(d): rows, Jacobians and multipliers, see `finish`.  known_forces(d): subtracts the closures' forces from those
    that the drives must supply.
    """

    close: Callable
    known_forces: Callable


def make_closing(tree: Any, locate: Callable = locate) -> Closing:
    """Return the kernels of all closures.

    tree: the module that factors the mass matrix.  locate: fills rows and Jacobians.
    """
    spread = tree.spread

    @kernel
    def close(d):
        locate(d)
        for c in range(d.n_closures):
            spread(d, c)
        couple_all(d)
        if d.evaluation == m.OK:
            finish(d)

    return Closing(close, known_forces)
