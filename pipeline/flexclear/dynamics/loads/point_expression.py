"""Force at the origin of a frame by expressions; all of its power counts as work."""

from __future__ import annotations

from flexclear.dynamics.loads.expressions import evaluated
from flexclear.dynamics.loads.given import Given, Load, pulling
from flexclear.dynamics.loads.row import Row, by_formula
from flexclear.dynamics.vectors import Vector
from flexclear.scene.formulas import Formula
from flexclear.scene.loads import PointExpression


def apply(given: Given, formula: str) -> Load:
    """Return a force by three expressions, or by one that is a vector."""
    components, bends = evaluated(given, formula)
    force = given.R_WL @ Vector(components[0] if len(components) == 1 else components)
    return pulling(given, force, bends=bends)


def row(load: PointExpression, path: str, formula: Formula) -> Row:
    """Return the load's row: the arguments of the expressions, and their numbers."""
    return by_formula(formula, path, frames=(load.frame,), follows=load.axes == "frame")
