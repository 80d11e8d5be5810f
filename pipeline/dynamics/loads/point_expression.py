"""Force at the origin of a frame by expressions; all of its power is booked as work."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.loads import PointExpression
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.loads.fields import act
from flexclear.pipeline.dynamics.loads.row import Row, by_formula
from flexclear.pipeline.dynamics.vectors import cross, dot, turn


def applying(formula: Callable) -> SimpleNamespace:
    """The kernel `apply` of loads whose expressions the kernel formula(d, k) computes, as a vector."""

    @kernel
    def apply(d, k):
        frame = d.site_frames[d.loads[k].b]
        force = formula(d, k)
        if d.loads[k].follows:
            force = turn(frame.axes, force)
        act(d, k, cross(frame.origin, force), force, 0.0, 0.0, 0.0, dot(force, frame.velocity), 0.0)

    return SimpleNamespace(apply=apply)


def row(load: PointExpression, path: str, formula: Formula) -> Row:
    """What the expressions read, and their numbers."""
    return by_formula(formula, path, frames=(load.frame,), follows=load.axes == "frame")
