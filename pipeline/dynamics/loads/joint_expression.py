"""Force or torque along a joint coordinate by an expression; all of its power is booked as work."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import JointExpression
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.loads.fields import along_coordinate
from flexclear.pipeline.dynamics.loads.row import Row, by_formula


def applying(formula: Callable) -> SimpleNamespace:
    """The kernel `apply` of loads whose expression the kernel formula(d, k) computes."""
    return SimpleNamespace(apply=along_coordinate(formula))


def row(load: JointExpression, path: str, formula: Formula, coordinate: Coordinate) -> Row:
    """What the expression reads, and its numbers."""
    return by_formula(formula, path, joint=load.joint)
