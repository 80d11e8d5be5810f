"""Force or torque along a joint coordinate by an expression; all of its power counts as work."""

from __future__ import annotations

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.expressions import evaluated
from flexclear.dynamics.loads.given import Given, Load, pushing
from flexclear.dynamics.loads.row import Row, by_formula
from flexclear.scene.formulas import Formula
from flexclear.scene.loads import JointExpression


def apply(given: Given, formula: str) -> Load:
    """Return the force."""
    (size,), bends = evaluated(given, formula)
    return pushing(given, size)._replace(bends=bends)


def row(load: JointExpression, path: str, formula: Formula, coordinate: Coordinate) -> Row:
    """Return the load's row: the arguments of the expression, and its numbers."""
    return by_formula(formula, path, joint=load.joint)
