"""Laws of time, for drives and loads. To add one: a module here, a line in the table, and its parameters in
scene/laws.

Each law has a function ``(law, dimension) -> Pieces`` (see `pieces`), which raises ValueError, in words, for values of
another dimension.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.drives import composed, expression, polynomial, spline, step
from flexclear.dynamics.drives.pieces import Pieces

LAWS: dict[str, Callable[[Any, str], Pieces]] = {
    "constant": polynomial.pieces_of_constant,
    "step": step.pieces,
    "polynomial": polynomial.pieces_of_polynomial,
    "harmonic": polynomial.pieces_of_harmonic,
    "spline": spline.pieces_of_spline,
    "table": spline.pieces_of_table,
    "sum": composed.pieces_of_sum,
    "piecewise": composed.pieces_of_piecewise,
    "repeated": composed.pieces_of_repeated,
    "delayed": composed.pieces_of_delayed,
    "expression": expression.pieces,
}
