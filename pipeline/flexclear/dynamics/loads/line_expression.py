"""Tension between two origins by an expression; all of its power counts as work."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import act, line
from flexclear.dynamics.loads.row import Row, by_formula
from flexclear.dynamics.vectors import cross, scale
from flexclear.scene.formulas import Formula
from flexclear.scene.loads import LineExpression


def applying(formula: Callable) -> Callable:
    """Build the kernel `apply` of a tension from the kernel formula(d, k) of its expression."""

    @kernel
    def apply(d, k):
        length, rate, along = line(d, k)
        size = formula(d, k)
        force = scale(-size, along)
        origin = d.site_frames[d.loads[k].b].origin
        act(d, k, cross(origin, force), force, length, rate, 0.0, -size * rate, 0.0)

    return apply


def row(load: LineExpression, path: str, formula: Formula) -> Row:
    """Return the load's row: the arguments of the expression, and its numbers."""
    return by_formula(formula, path, frames=load.between)
