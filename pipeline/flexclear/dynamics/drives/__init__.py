"""Laws of time, for drives and loads. To add one: a module here, a line in the table, and its parameters in
scene/laws.

Each module has ``pieces(law, dimension) -> Pieces`` (see `pieces`), which raises ValueError, in words, for values of
another dimension.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexclear.dynamics.drives import (
    constant,
    delayed,
    expression,
    harmonic,
    piecewise,
    polynomial,
    repeated,
    spline,
    step,
    sum,
    table,
)
from flexclear.dynamics.drives.pieces import Pieces

LAWS: dict[str, Callable[[Any, str], Pieces]] = {
    "constant": constant.pieces,
    "step": step.pieces,
    "polynomial": polynomial.pieces,
    "harmonic": harmonic.pieces,
    "spline": spline.pieces,
    "table": table.pieces,
    "sum": sum.pieces,
    "piecewise": piecewise.pieces,
    "repeated": repeated.pieces,
    "delayed": delayed.pieces,
    "expression": expression.pieces,
}
