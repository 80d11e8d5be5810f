"""Back onto the closures: positions and speeds, by the least change in the metric of the mass.

Flexible bodies give way as slowly loaded ones do: in that metric alone their light modes would take up most of a gap,
and ring.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.envelope import base, factor, multiply
from flexclear.pipeline.dynamics.equations.retraction import make_position_rates
from flexclear.pipeline.dynamics.kernels import kernel

ITERATIONS = 8
#: pivot ratio of the closures below which residuals are left alone: of a residual r, a correction r / sqrt(ratio)
BLIND = 1e-8
#: rounding may stop the residuals this far above a very tight tolerance
ROUNDING = 1e3
#: rows that are not solved for may open by this share of the mechanism's size: joints whose axes miss each other by
#: less than `model.rates.ZERO` count as redundant, and on the way they part by that much times some turns
APART = 1e-6
#: a gap is closed as if over this time [s]: modes with shorter periods follow by their stiffness, not by their mass
SLOWLY = 0.1


@kernel
def largest(w, first, count):
    """Largest magnitude of a stretch of w; NaN counts as infinite."""
    result = 0.0
    for k in range(first, first + count):
        if not abs(w[k]) <= result:
            result = abs(w[k]) if w[k] == w[k] else 1e300
    return result


@kernel
def widest(h, f, w, values, solved):
    """Largest of the closure rows' values from w[values] on, a turn counting with the mechanism's size [m, or m/s].

    solved: whether only of the rows that are solved for.  Lengths of an independent mechanism that is smaller than all
    that there is count for more by that much.
    """
    result, arm = 0.0, w[h[m.CONTROL] + m.LENGTH]
    for c in range(h[m.N_CLOSURES]):
        first, weight = m.CLOSURES.row0(h, c), f[m.CLOSURE_NUMBERS.row(h, c)]
        for k in range(first, first + (m.CLOSURES.n_kept(h, c) if solved else m.CLOSURES.n_rows(h, c))):
            size = abs(w[values + k]) * (weight if m.CLOSURE_ROWS.kind(h, k) == 0 else arm)
            if not size <= result:
                result = size if size == size else 1e300
    return result


@kernel
def no_projection(h, f, w, n, t, y, dy, tolerance):
    """A tree cannot drift."""
    return 0


@kernel
def keep_scales(h, w):
    """Sizes of the closure rows at an accepted step; a rejected trial far away must not count."""
    for r in range(h[m.N_KEPT_ROWS]):
        o = h[m.ROW_SCALE] + r
        w[o] = max(w[o], w[o + h[m.N_CLOSURE_ROWS]])


@kernel
def rigid_bodies(h, f, w, n):
    """No mode."""


@kernel
def no_modes(h, f, w, b):
    """No mode."""


def make_stiffen(closures: Any) -> Callable:
    """The kernel stiffen(h, f, w, n): the factors of an evaluation, with the modal stiffness beside the mass.

    closures: kernels of all closures.
    """
    complete = closures.complete

    @kernel
    def stiffen(h, f, w, n):
        rows, matrix, size = h[m.ENVELOPE.place], h[m.MASS], h[m.NV]
        multiply(h, rows, w, matrix, size)
        for k in range(h[m.N_FLEX]):
            modes, held, c0 = m.FLEXES.n_modes(h, k), m.FLEXES.n_held(h, k), m.FLEXES.c0(h, k)
            stiffness = h[m.INTERFACE_DATA.place] + m.FLEXES.interface0(h, k) + (3 + modes) * modes
            for i in range(modes):
                row = base(h, rows, matrix, c0 + i) + c0
                # without held shapes, shapes are eigenmodes
                for j in range(0 if i >= held > 0 else i, i + 1):
                    w[row + j] += SLOWLY**2 * f[stiffness + modes * i + j]
        factor(h, rows, w, matrix, size, 0.0)
        complete(h, f, w, n)

    return stiffen


def make_projection(
    evaluate: Callable,
    joints: tuple[Any, ...],
    closures: Any,
    stiffen: Callable = rigid_bodies,
    to_modes: Callable = no_modes,
) -> Callable:
    """The kernel project(h, f, w, n, t, y, dy, tolerance).

    evaluate: the right-hand side.  joints: modules of the joint types.  closures: kernels of all closures.
    stiffen, to_modes: of `make_stiffen` and of `bodies.interface`, where bodies are flexible.
    """
    position_rates, correction = make_position_rates(joints), closures.correction

    @kernel
    def move(h, w, y, step):
        """Add to the positions of y the change that a small displacement of the coordinates means."""
        for k in range(h[m.NV]):
            w[h[m.U] + k] = w[step + k]
        position_rates(h, w)
        for k in range(h[m.NQ]):
            w[y + k] += w[h[m.POSITION_RATE] + k]

    @kernel
    def project(h, f, w, n, t, y, dy, tolerance):
        """Correct y until residuals [m] and their rates [m/s] of the rows solved for are below `tolerance`.

        Needs the work space of evaluate(t, y); leaves it, and dy, up to date.  Returns the number
        of evaluations, or -1 when the loops do not close.  So near to a singular pose that a
        residual says little about the error behind it, nothing is changed.
        """
        step, used, apart = h[m.CORRECTION], 0, APART * w[h[m.CONTROL] + m.LENGTH]
        if w[h[m.PIVOT] + m.LAST_PIVOT] < BLIND:
            return 0
        for _ in range(ITERATIONS):
            worst = max(widest(h, f, w, h[m.RESIDUAL], True), widest(h, f, w, h[m.RESIDUAL_RATE], True))
            if worst <= tolerance:
                return used if widest(h, f, w, h[m.RESIDUAL], False) <= max(apart, tolerance) else -1
            if n[m.ABRIDGED]:
                evaluate(h, f, w, n, t, y, dy)  # for its factors
            stiffen(h, f, w, n)
            if n[m.EVALUATION] != m.OK:
                return -1
            correction(h, f, w, n, h[m.RESIDUAL_RATE], step)
            to_modes(h, f, w, step)
            for k in range(h[m.NV]):
                w[y + h[m.NQ] + k] += w[step + k]
            correction(h, f, w, n, h[m.RESIDUAL], step)
            to_modes(h, f, w, step)
            move(h, w, y, step)
            evaluate(h, f, w, n, t, y, dy)
            used += 1
            if n[m.EVALUATION] != m.OK:
                return -1
        if not widest(h, f, w, h[m.RESIDUAL], True) <= ROUNDING * tolerance:
            return -1
        return used if widest(h, f, w, h[m.RESIDUAL], False) <= max(apart, ROUNDING * tolerance) else -1

    return project
