"""Expressions of loads, evaluated on numbers that may be symbols."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import mul
from typing import Any

from flexclear.dynamics import lookup
from flexclear.dynamics.loads.given import Given, line
from flexclear.dynamics.specialise import symbols
from flexclear.dynamics.vectors import Vector, dot
from flexclear.scene.expression import BENT, fold
from flexclear.scene.formulas import operands

#: operations on numbers, or on vectors where these may be
OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: (1.0 / b) * a if isinstance(a, Vector) else a / b,
    "^": lambda a, b: a**b,
    "minus": lambda a: -a,
    "abs": abs,
    "max": symbols.larger,
    "min": symbols.smaller,
    "norm": lambda a: symbols.sqrt(dot(a, a)) if isinstance(a, Vector) else abs(a),
    **{name: getattr(symbols, name) for name in ("sqrt", "sin", "cos", "tan", "exp", "log", "tanh")},
}
#: how a leaf reads what it names
LEAVES: dict[str, Callable[[Given, int], Any]] = {
    "c": lambda given, k: given.numbers[3 + k],
    "p": lambda given, k: given.read[k].p_WB + Vector(given.numbers[:3]),  # the origin of all positions
    "v": lambda given, k: given.read[k].v,
    "o": lambda given, k: given.read[k].omega,
    "q": lambda given, k: given.read[k].value,
    "r": lambda given, k: given.read[k].rate,
    "t": lambda given, k: given.laws[0].value,
    "l": lambda given, k: line(given)[0],
    "s": lambda given, k: line(given)[1],
}


def evaluated(
    given: Given, formula: str, note: Callable[[int, list[Any]], None] = lambda table, at: None
) -> tuple[list[Any], list[Any]]:
    """Return the values of a formula (`scene.formulas`), and those at whose zeros its slope jumps.

    note: is told of each table that is looked up, and where.
    """
    bends = list[Any]()

    def leaf(token: str) -> Any:
        name, _, component = token.partition(".")
        value = LEAVES[name[0]](given, int(name[1:] or 0))
        return value["xyz".index(component)] if component else value

    def apply(token: str, values: list[Any]) -> Any:
        if token in BENT:
            bends.append(values[0] - values[1] if len(values) == 2 else values[0])
        if ":" in token:
            table, *levels = map(int, token[1:].split(":"))
            note(table, values)
            return lookup.at(given.tables[table], levels, values)
        exponent = int(token[1:]) if token[0] == "^" and token[1:] else 0
        if exponent:
            product = reduce(mul, values * abs(exponent))
            return product if exponent > 0 else 1.0 / product
        return OPERATIONS[token](*values)

    return [fold(part.split(), leaf, apply, operands) for part in formula.split(" ; ")], bends
