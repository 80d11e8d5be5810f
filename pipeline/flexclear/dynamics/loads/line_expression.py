"""Tension between two origins by an expression; all of its power counts as work."""

from __future__ import annotations

from flexclear.dynamics.loads.expressions import evaluated
from flexclear.dynamics.loads.given import Given, Load, line
from flexclear.dynamics.loads.row import Row, by_formula
from flexclear.dynamics.vectors import ZERO, Wrench
from flexclear.scene.formulas import Formula
from flexclear.scene.loads import LineExpression


def apply(given: Given, formula: str) -> Load:
    """Return the tension."""
    (tension,), bends = evaluated(given, formula)
    _, rate, direction, _ = line(given)
    return Load(Wrench(ZERO, -tension * direction), -tension * rate, bends=bends)


def row(load: LineExpression, path: str, formula: Formula) -> Row:
    """Return the load's row: the arguments of the expression, and its numbers."""
    return by_formula(formula, path, frames=load.between)
