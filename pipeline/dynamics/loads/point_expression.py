"""Force at the origin of a frame by expressions; all of its power is booked as work."""

from __future__ import annotations

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import PointExpression
from flexclear.pipeline.dynamics.loads.fields import at_origin
from flexclear.pipeline.dynamics.loads.row import Row, by_formula

#: makes of the kernel formula(d, k) of three expressions, a vector, the kernel `apply`
applying = at_origin


def row(load: PointExpression, path: str, formula: Formula) -> Row:
    """What the expressions read, and their numbers."""
    return by_formula(formula, path, frames=(load.frame,), follows=load.axes == "frame")
