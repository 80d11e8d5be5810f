"""Back onto the closures: positions and speeds, by the least change in the metric of the mass.

Flexible bodies give way as slowly loaded ones do: in that metric alone their light modes would take up most of a gap,
and ring.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.choice import nothing
from flexclear.pipeline.dynamics.equations.retraction import make_position_rates
from flexclear.pipeline.dynamics.fields import data
from flexclear.pipeline.dynamics.kernels import kernel

PROJECTIONS = 8
#: pivot ratio of the closures below which residuals are left alone: of a residual r, a correction r / sqrt(ratio)
BLIND = 1e-8
#: rounding may stop the residuals this far above a very tight tolerance
ROUNDING_FACTOR = 1e3
#: rows that are not solved for may open by this fraction of the mechanism's size: joints whose axes miss each other by
#: less than `model.rates.ZERO_SINGULAR_VALUE` count as redundant, and on the way they part by that, times some turns
OPEN_REDUNDANT = 1e-6
#: a gap is closed as if over this time [s]: modes with shorter periods follow by their stiffness, not by their mass
CLOSING_TIME = 0.1


@kernel
def largest(values, count):
    """Largest magnitude of the first `count` entries of a stretch; NaN counts as infinite."""
    result = 0.0
    for k in range(count):
        if not abs(values[k]) <= result:
            result = abs(values[k]) if values[k] == values[k] else 1e300
    return result


@kernel
def widest(d, values, solved):
    """Largest of the closure rows' values, a turn counting with the mechanism's size [m, or m/s].

    solved: whether only of the rows that are solved for.  Lengths of an independent mechanism that is smaller than all
    that there is count for more by that much.
    """
    result, arm = 0.0, d.length
    for c in range(d.n_closures):
        closure, weight = d.closures[c], d.closure_numbers[c].weight
        for k in range(closure.row0, closure.row0 + (closure.n_kept if solved else closure.n_rows)):
            size = abs(values[k]) * (weight if d.closure_rows[k].kind == 0 else arm)
            if not size <= result:
                result = size if size == size else 1e300
    return result


@kernel
def open_by(d):
    """How far loops are open, or how fast they open, at the evaluated state [m, or m/s]."""
    return max(widest(d, d.residual, True), widest(d, d.residual_rate, True))


@kernel
def no_projection(h, f, w, n, t, y, dy, tolerance):
    """A tree cannot drift."""
    return 0


@kernel
def keep_scales(d):
    """Sizes of the closure rows at an accepted step; a rejected trial far away must not count."""
    for r in range(d.n_kept_rows):
        d.row_scale[r] = max(d.row_scale[r], d.row_scale[d.n_closure_rows + r])


def make_stiffen(closures: Any, tree: Any, flexible: Any) -> Callable:
    """The kernel stiffen(d): the factors of an evaluation, with the modal stiffness next to the mass.

    closures: kernels of all closures.  tree, flexible: as of `make_rates`.
    """
    complete, (unfactor, refactor) = closures.complete, tree.make_again(flexible(tree))

    @kernel
    def stiffen(d):
        unfactor(d)
        for k in range(d.n_flex):
            body = d.flexes[k]
            n, c0 = body.n_modes, body.c0
            stiffness = body.interface0 + (3 + n) * n
            for i in range(n):
                row = d.envelope[c0 + i].origin + c0
                # without held shapes, shapes are eigenmodes
                for j in range(0 if i >= body.n_held > 0 else i, i + 1):
                    d.mass[row + j] += CLOSING_TIME**2 * d.interface_data[stiffness + n * i + j].value
        refactor(d)
        complete(d)

    return stiffen


def make_projection(
    evaluate: Callable,
    joints: tuple[Any, ...],
    closures: Any,
    stiffen: Callable = nothing,
    to_modes: Callable = nothing,
) -> Callable:
    """The kernel project(h, f, w, n, t, y, dy, tolerance).

    evaluate: the right-hand side.  joints: modules of the joint types.  closures: kernels of all closures.
    stiffen, to_modes: of `make_stiffen` and of `bodies.interface`, where bodies are flexible.
    """
    position_rates, correction = make_position_rates(joints), closures.correction

    @kernel
    def move(d, y, step):
        """Add to the positions of y the change that a small displacement of the coordinates means."""
        for k in range(d.nv):
            d.u[k] = d.w[step + k]
        position_rates(d)
        for k in range(d.nq):
            d.w[y + k] += d.position_rate[k]

    @kernel
    def project(h, f, w, n, t, y, dy, tolerance):
        """Correct y until residuals [m] and their rates [m/s] of the rows solved for are below `tolerance`.

        Needs the work space of evaluate(t, y); leaves it, and dy, up to date.  Returns the number
        of evaluations, or -1 when the loops do not close.  So near to a singular pose that a
        residual says little about the error behind it, nothing is changed.
        """
        d = data(h, f, w, n)
        step, used, redundant = d.at_correction, 0, OPEN_REDUNDANT * d.length
        if d.last_pivot < BLIND:
            return 0
        for _ in range(PROJECTIONS):
            if open_by(d) <= tolerance:
                return used if widest(d, d.residual, False) <= max(redundant, tolerance) else -1
            if d.abridged:
                evaluate(h, f, w, n, t, y, dy)  # for its factors
            stiffen(d)
            if d.evaluation != m.OK:
                return -1
            correction(d, d.at_residual_rate, step)
            to_modes(d, step)
            for k in range(d.nv):
                w[y + d.nq + k] += w[step + k]
            correction(d, d.at_residual, step)
            to_modes(d, step)
            move(d, y, step)
            evaluate(h, f, w, n, t, y, dy)
            used += 1
            if d.evaluation != m.OK:
                return -1
        if not widest(d, d.residual, True) <= ROUNDING_FACTOR * tolerance:
            return -1
        return used if widest(d, d.residual, False) <= max(redundant, ROUNDING_FACTOR * tolerance) else -1

    return project
