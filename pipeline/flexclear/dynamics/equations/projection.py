"""Projection of positions and speeds onto the closures, by the least change in the metric of the mass.

Flexible bodies deform as under slow loads: in the metric of the mass alone, their light modes would take up most of a
gap, and vibrate.
"""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics import memory as m
from flexclear.dynamics.fields import data
from flexclear.dynamics.kernels import kernel

PROJECTIONS = 8
#: pivot ratio of the closures below which residuals are not corrected: a residual r needs a change r / sqrt(ratio)
BLIND = 1e-8
#: rounding may stop the residuals this far above a very tight tolerance
ROUNDING_FACTOR = 1e3


@kernel
def largest(values, count):
    """Return the largest magnitude of the first `count` entries of a section; NaN counts as infinite."""
    result = 0.0
    for k in range(count):
        if not abs(values[k]) <= result:
            result = abs(values[k]) if values[k] == values[k] else 1e300
    return result


@kernel
def widest(d, values, solved):
    """Return the largest of the closure rows' values, angles times the mechanism's size [m, or m/s].

    solved: whether only selected rows count.  Lengths of an independent mechanism are scaled up by the ratio of the
    whole scene's size to its own; a small one within a large one closes only to the rounding of its coordinates.
    """
    result, arm, rounding = 0.0, d.length, 8.9e-16 * d.length / d.rtol  # four roundings of a length
    for c in range(d.n_closures):
        closure, weight = d.closures[c], max(d.length / max(d.closure_numbers[c].extent, rounding), 1.0)
        for k in range(closure.row0, closure.row0 + (closure.n_kept if solved else closure.n_rows)):
            size = abs(values[k]) * (weight if d.closure_rows[k].kind == 0 else arm)
            if not size <= result:
                result = size if size == size else 1e300
    return result


@kernel
def open_by(d):
    """Return the largest residual of the loops, or its rate, at the state evaluated last [m, or m/s]."""
    return max(widest(d, d.residual, True), widest(d, d.residual_rate, True))


@kernel
def no_projection(h, f, w, n, t, y, dy, tolerance):
    """Do nothing: a tree has no closures."""
    return 0


@kernel
def keep_scales(d):
    """Store the sizes of the closure rows at an accepted step, since rejected steps may be far away."""
    for r in range(d.n_kept_rows):
        d.row_scale[r] = max(d.row_scale[r], d.row_scale[d.n_closure_rows + r])


def make_projection(rates: Callable, correct: Callable) -> Callable:
    """Build the kernel project(h, f, w, n, t, y, dy, tolerance).

    rates: the right-hand side as steps evaluate it.  correct: stores changes that close the loops, as
    `mechanics.responses` has them.
    """

    @kernel
    def project(h, f, w, n, t, y, dy, tolerance):
        """Correct y until residuals [m] and their rates [m/s] of the selected rows are below `tolerance`.

        It needs the residuals of rates(d, t, y, dy), and leaves the work array, and dy, up to date.  It returns the
        number of evaluations, or -1 when the loops do not close.  Very near a singular pose, where a residual says
        little about the error of the state, nothing changes.
        """
        d = data(h, f, w, n)
        # redundant rows may have residuals of this fraction of the mechanism's size: rows of joints whose axes miss
        # each other by less than `model.rates.ZERO_SINGULAR_VALUE` are redundant, and open by that, times some turns,
        # during the motion
        used, redundant = 0, 1e-6 * d.length
        if d.last_pivot < BLIND:
            return 0
        for _ in range(PROJECTIONS):
            if open_by(d) <= tolerance:
                return used if widest(d, d.residual, False) <= max(redundant, tolerance) else -1
            correct(h, f, w, n, t, y, dy)
            if d.evaluation != m.OK:
                return -1
            for k in range(d.nq + d.nv):
                w[y + k] += w[dy + k]
            rates(d, t, y, dy)
            used += 1
            if d.evaluation != m.OK:
                return -1
        if not widest(d, d.residual, True) <= ROUNDING_FACTOR * tolerance:
            return -1
        return used if widest(d, d.residual, False) <= max(redundant, ROUNDING_FACTOR * tolerance) else -1

    return project
