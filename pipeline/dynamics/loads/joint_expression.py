"""Force or torque along a joint coordinate by an expression; all of its power is booked as work."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import JointExpression
from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act, measure
from flexclear.pipeline.dynamics.loads.row import Row, by_formula
from flexclear.pipeline.dynamics.vectors import scale


def applying(formula: Callable) -> SimpleNamespace:
    """The kernel `apply` of loads whose expression the kernel formula(d, k) computes."""

    @kernel
    def apply(d, k):
        value, rate, moment, force = measure(d, k)
        size = formula(d, k)
        act(d, k, scale(size, moment), scale(size, force), value, rate, 0.0, size * rate, 0.0)

    return SimpleNamespace(apply=apply)


def row(load: JointExpression, path: str, formula: Formula, coordinate: Coordinate) -> Row:
    """What the expression reads, and its numbers."""
    return by_formula(formula, path, joint=load.joint)
