"""Back onto the closures: positions and speeds, by the least change in the metric of the mass."""

from __future__ import annotations

from collections.abc import Callable

from pipeline.dynamics.assembly.places import LAST_PIVOT, PIVOT
from pipeline.dynamics.tables import (
    C0,
    CORRECTION,
    DU,
    EVALUATION,
    FLEX_C0,
    FLEX_Q0,
    JOINT,
    JOINT_KIND,
    N_CLOSURE_ROWS,
    N_FLEX,
    N_LINKS,
    N_MODES,
    NQ,
    NV,
    OK,
    POSITION_RATE,
    Q0,
    RESIDUAL,
    RESIDUAL_RATE,
    U,
    X,
    flex,
    link,
)
from pipeline.dynamics.vectors import kernel

ITERATIONS = 8
#: pivot ratio of the closures below which residuals are left alone: of a residual r, a correction r / sqrt(ratio)
BLIND = 1e-8
#: rounding may stop the residuals this far above a very tight tolerance
ROUNDING = 1e3


@kernel
def largest(w, first, count):
    """Largest magnitude of a stretch of w; NaN counts as infinite."""
    result = 0.0
    for k in range(first, first + count):
        if not abs(w[k]) <= result:
            result = abs(w[k]) if w[k] == w[k] else 1e300
    return result


@kernel
def none(h, f, w, n, t, y, dy, tolerance):
    """A tree cannot drift."""
    return 0


def compose(evaluate: Callable, joint_motion: Callable, correction: Callable) -> Callable:
    """The kernel project(h, f, w, n, t, y, dy, tolerance)."""

    @kernel
    def move(h, w, y, step):
        """Add to the positions of y the change that a small displacement of the coordinates means."""
        for k in range(h[NV]):
            w[h[U] + k] = w[step + k]
        for i in range(1, h[N_LINKS]):
            q, c = link(h, i, Q0), link(h, i, C0)
            joint_motion(link(h, i, JOINT_KIND), w, h[X] + q, h[U] + c, h[DU] + c, h[JOINT], h[POSITION_RATE] + q)
        for k in range(h[N_FLEX]):
            q, c = flex(h, k, FLEX_Q0), flex(h, k, FLEX_C0)
            for j in range(flex(h, k, N_MODES)):
                w[h[POSITION_RATE] + q + j] = w[step + c + j]
        for k in range(h[NQ]):
            w[y + k] += w[h[POSITION_RATE] + k]

    @kernel
    def project(h, f, w, n, t, y, dy, tolerance):
        """Correct y until residuals [m] and their rates [m/s] are below `tolerance`.

        Needs the work space of evaluate(t, y); leaves it, and dy, up to date.  Returns the number
        of evaluations, or -1 when the loops do not close.  So near to a singular pose that a
        residual says little about the error behind it, nothing is changed.
        """
        rows, step, used = h[N_CLOSURE_ROWS], h[CORRECTION], 0
        if w[h[PIVOT] + LAST_PIVOT] < BLIND:
            return 0
        for _ in range(ITERATIONS):
            worst = max(largest(w, h[RESIDUAL], rows), largest(w, h[RESIDUAL_RATE], rows))
            if worst <= tolerance:
                return used
            correction(h, w, h[RESIDUAL_RATE], step)
            for k in range(h[NV]):
                w[y + h[NQ] + k] += w[step + k]
            correction(h, w, h[RESIDUAL], step)
            move(h, w, y, step)
            evaluate(h, f, w, n, t, y, dy)
            used += 1
            if n[EVALUATION] != OK:
                return -1
        return used if largest(w, h[RESIDUAL], rows) <= ROUNDING * tolerance else -1

    return project
