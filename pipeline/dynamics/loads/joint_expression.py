"""Force or torque along a joint coordinate by an expression; all of its power is booked as work."""

from __future__ import annotations

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import JointExpression
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.loads.fields import along_coordinate
from flexclear.pipeline.dynamics.loads.row import Row, by_formula

#: makes of the kernel formula(d, k) of an expression the kernel `apply`
applying = along_coordinate


def row(load: JointExpression, path: str, formula: Formula, coordinate: Coordinate) -> Row:
    """What the expression reads, and its numbers."""
    return by_formula(formula, path, joint=load.joint)
