"""Force at the origin of a frame by expressions; all of its power is booked as work."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import PointExpression
from flexclear.pipeline.dynamics.loads.fields import at_origin
from flexclear.pipeline.dynamics.loads.row import Row, by_formula


def applying(formula: Callable) -> SimpleNamespace:
    """The kernel `apply` of loads whose expressions the kernel formula(d, k) computes, as a vector."""
    return SimpleNamespace(apply=at_origin(formula))


def row(load: PointExpression, path: str, formula: Formula) -> Row:
    """What the expressions read, and their numbers."""
    return by_formula(formula, path, frames=(load.frame,), follows=load.axes == "frame")
