"""Tension between two origins by an expression; all of its power counts as work."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import LineExpression
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act, line
from flexclear.pipeline.dynamics.loads.row import Row, by_formula
from flexclear.pipeline.dynamics.vectors import cross, scale


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
