"""Programs of `dynamics.specialise` run on numbers, operation by operation, without a compiler."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from flexclear.dynamics.specialise.code import Program
from flexclear.dynamics.specialise.tape import Branch, Loop, Symbol
from flexclear.dynamics.specialise.topology import RATES, RATES_CHANGE, STATE, STATE_CHANGE, stretch_and_offset

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


def _arctan2(a: complex, b: complex) -> complex:
    turned = (b.real * a.imag - a.real * b.imag) / (a.real**2 + b.real**2)
    return complex(math.atan2(a.real, b.real), turned)


def _compared(by: Callable[..., Any]) -> Callable[..., Any]:
    return lambda a, b: by(a.real, b.real)


#: the same of complex numbers whose imaginary part is a small change
COMPLEX = {
    **OPERATIONS,
    **{name: _compared(OPERATIONS[name]) for name in ("<", "<=", ">", ">=", "==", "!=")},
    "reciprocal": lambda a: 1.0 / np.complex128(a),
    "sqrt": lambda a: np.sqrt(np.complex128(a)) if a.real else 0.0,
    "pow": lambda a, b: np.complex128(a) ** b if a.real else 0.0,
    "fabs": lambda a: -a if a.real < 0.0 else a,
    "copysign": lambda a, b: math.copysign(1.0, a.real) * math.copysign(1.0, b.real) * a,
    "round": lambda a: float(np.round(a.real)),
    "arctan2": lambda a, b: _arctan2(complex(a), complex(b)),
}


def run(
    program: Program,
    h: np.ndarray,
    arrays: dict[str, np.ndarray],
    y: int,
    dy: int,
    changes: tuple[int, int] = (0, 0),
    operations: dict[str, Callable[..., Any]] = OPERATIONS,
) -> None:
    """Do in the arrays f, w and n what the program says; y, dy: places of state and rates in w.

    changes: places of the changes of both.
    """
    places = {STATE: y, RATES: dy, STATE_CHANGE: changes[0], RATES_CHANGE: changes[1], -1: 0}

    def where(place: int) -> int:
        stretch, inside = stretch_and_offset(place)
        return inside + places.get(stretch, int(h[stretch]) if 0 <= stretch < len(h) else 0)

    values: dict[Symbol, Any] = {}

    def known(value: Any) -> Any:
        return values[value] if isinstance(value, Symbol) else value

    def go(block: list[Any]) -> None:
        for item in block:
            if isinstance(item, Branch):
                which = 0 if values[item.condition] else 1
                go(item.blocks[which])
                values.update({joined: known(ways[which]) for joined, *ways in item.joins})
            elif isinstance(item, Loop):
                values.update({one.inside: known(one.first) for one in item.carried})
                go(item.blocks[0])
                while known(item.condition):
                    values.update([(one.inside, known(one.left)) for one in item.carried])
                    go(item.blocks[0])
                values.update([(one.after, known(one.left)) for one in item.carried])
            elif item.operation == "load":
                array, place = item.arguments
                place = values[place] if isinstance(place, Symbol) else where(place)
                values[item] = arrays[array][place]
            else:
                values[item] = operations[item.operation](*(known(a) for a in item.arguments))

    go(program.block)
    for array, place, value in program.stores:
        arrays[array][known(place) if isinstance(place, Symbol) else where(place)] = known(value)
