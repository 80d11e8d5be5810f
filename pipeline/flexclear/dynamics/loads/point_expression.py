"""Force at the origin of a frame by expressions; all of its power counts as work."""

from __future__ import annotations

from flexclear.dynamics.loads.fields import at_origin
from flexclear.dynamics.loads.row import Row, by_formula
from flexclear.scene.formulas import Formula
from flexclear.scene.loads import PointExpression

#: builds the kernel `apply` from the kernel formula(d, k) of three expressions, a vector
applying = at_origin


def row(load: PointExpression, path: str, formula: Formula) -> Row:
    """Return the load's row: the arguments of the expressions, and their numbers."""
    return by_formula(formula, path, frames=(load.frame,), follows=load.axes == "frame")
