"""Force or torque along a joint coordinate by an expression; all of its power counts as work."""

from __future__ import annotations

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.loads.fields import along_coordinate
from flexclear.dynamics.loads.row import Row, by_formula
from flexclear.scene.formulas import Formula
from flexclear.scene.loads import JointExpression

#: builds the kernel `apply` from the kernel formula(d, k) of an expression
applying = along_coordinate


def row(load: JointExpression, path: str, formula: Formula, coordinate: Coordinate) -> Row:
    """Return the load's row: the arguments of the expression, and its numbers."""
    return by_formula(formula, path, joint=load.joint)
