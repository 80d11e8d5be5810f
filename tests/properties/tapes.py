"""Programs of `dynamics.specialise` run on numbers, operation by operation, without a compiler."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics.specialise.code import Program
from flexclear.pipeline.dynamics.specialise.tape import Branch, Symbol
from flexclear.pipeline.dynamics.specialise.wiring import RATES, STATE, split

OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "iadd": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "imul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "reciprocal": lambda a: np.float64(1.0) / a,
    "pow": lambda a, b: a**b,
    "and": lambda a, b: a and b,
    "select": lambda condition, a, b: a if condition else b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "fabs": abs,
    "sqrt": np.sqrt,
    "round": np.round,
    "arctan2": math.atan2,
    "copysign": math.copysign,
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "exp", "log", "tanh")},
}


def run(program: Program, h: np.ndarray, arrays: dict[str, np.ndarray], y: int, dy: int) -> None:
    """Do in the arrays f, w and n what the program says; y, dy: places of state and rates in w."""

    def where(place: int) -> int:
        stretch, inside = split(place)
        return inside + {STATE: y, RATES: dy, -1: 0}.get(stretch, int(h[stretch]) if 0 <= stretch < len(h) else 0)

    values: dict[Symbol, Any] = {}

    def known(value: Any) -> Any:
        return values[value] if isinstance(value, Symbol) else value

    def go(block: list[Any]) -> None:
        for item in block:
            if isinstance(item, Branch):
                which = 0 if values[item.condition] else 1
                go(item.blocks[which])
                values.update({joined: known(ways[which]) for joined, *ways in item.joins})
            elif item.operation == "load":
                array, place = item.arguments
                place = values[place] if isinstance(place, Symbol) else where(place)
                values[item] = arrays[array][place]
            else:
                values[item] = OPERATIONS[item.operation](*(known(a) for a in item.arguments))

    go(program.block)
    for array, place, value in program.stores:
        arrays[array][known(place) if isinstance(place, Symbol) else where(place)] = known(value)
