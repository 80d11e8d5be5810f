"""Expressions of contact laws as functions of numbers that may be symbols (`scene.law_expressions`).

Their values end with the numbers of their tables (`lookup`), the last table first.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

from flexclear.dynamics import lookup
from flexclear.dynamics.contact.restitution import root
from flexclear.dynamics.specialise.symbols import cos, exp, larger, log, sin, smaller, sqrt, tan, tanh
from flexclear.scene.expression import BENT, OPERANDS, fold
from flexclear.scene.formulas import WHOLE

OPERATIONS: dict[str, Callable[..., Any]] = {
    **{"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "^": operator.pow},
    **{"max": larger, "min": smaller, "minus": operator.neg, "abs": abs, "norm": abs},
    **{"sqrt": sqrt, "sin": sin, "cos": cos, "exp": exp, "log": log, "tan": tan, "tanh": tanh},
}


#: number of a table, and functions of the quantities at which it is looked up
Look = tuple[int, list[Callable]]


class Laws(dict[str, Any]):
    """Laws by name; those of expressions follow from their text."""

    def __init__(self, named: dict[str, Any], of_expression: Callable[[str], Any]) -> None:
        super().__init__(named)
        self._of_expression = lru_cache(of_expression)

    def __missing__(self, kind: str) -> Any:
        if not kind.startswith("expression,"):
            raise KeyError(kind)
        return self._of_expression(kind)


def composed(kind: str, bends: list[Callable] | None = None, looks: list[Look] | None = None) -> Callable:
    """Return the function (a, b, c, values) of an expression of up to three variables.

    bends: receives functions of values at whose zeros its slope jumps.  looks: receives the tables that it looks up.
    """

    def apply(token: str, given: list[Callable]) -> Callable:
        if bends is not None and token in BENT:
            bends.append(_applied(operator.sub, *given) if len(given) == 2 else given[0])
        if ":" in token:
            table, *levels = map(int, token[1:].split(":"))
            if looks is not None:
                looks.append((table, given))
            return lambda *at: lookup.at(at[-1][-1 - table], levels, [one(*at) for one in given])
        if token[0] == "^" and token[1:]:
            return _applied(_power(float(token[1:])), *given)
        return _applied(OPERATIONS[token], *given)

    return fold(kind.split(",")[1:], _leaf, apply, _operands)


def _operands(token: str) -> int:
    return token.count(":") or (1 if token[0] == "^" and token[1:] else OPERANDS.get(token, 0))


def halvings(kind: str) -> list[tuple[int, ...]]:
    """Return how often the intervals of each table of an expression are halved, the last table first."""
    found = {one for one in kind.split(",") if ":" in one}
    return [
        tuple(map(int, one.split(":")[1:])) for one in sorted(found, key=lambda one: -int(one[1:].partition(":")[0]))
    ]


def sizes(kind: str) -> list[int]:
    """Return how many numbers each table of an expression has, the last table first."""
    return [lookup.length(levels) for levels in halvings(kind)]


def numbers_of(law: Any) -> tuple[tuple[float, ...], ...]:
    """Return the numbers of the tables of a law of a scene, the last table first."""
    return tuple(tuple(lookup.numbers(one)) for one in reversed(list(getattr(law, "tables", {}).values())))


def left(law: Any, *at: Any) -> str | None:
    """Return which table an expression leaves, in words, and where; None if none.  at: its variables and values."""
    if not law.tables:
        return None
    looks = list[Look]()
    composed(law.kind, None, looks)
    for number, operands in looks:
        name, table = list(law.tables.items())[number]
        found = lookup.left(name, table, [float(one(*at)) for one in operands])
        if found:
            return found
    return None


def _leaf(token: str) -> Callable[..., Any]:
    index = int(token[1:]) if token[0] in "xc" else -1
    if token[0] == "x":
        return lambda *given: given[index]
    return (lambda a, b, c, p: p[index]) if index >= 0 else (lambda a, b, c, p: float(token))


def _applied(operation: Callable[..., Any], *operands: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *given: operation(*(operand(*given) for operand in operands))


def _power(exponent: float) -> Callable[[Any], Any]:
    """Return the power, by products and a root where these suffice."""
    whole, half = int(abs(exponent)), abs(exponent) % 1.0 == 0.5
    if not (whole <= WHOLE and 2.0 * exponent == int(2.0 * exponent)):
        return lambda x: x**exponent

    def power(x: Any) -> Any:
        y: Any = 1.0
        for _ in range(whole):
            y = y * x
        y = y * sqrt(x) if half else y
        return 1.0 / y if exponent < 0.0 else y

    return power


def zeros(
    functions: Iterable[Callable], low: float, high: float, *others: Any, levels: Sequence[float] = (0.0,)
) -> list[float]:
    """Return where functions f(x, *others) pass a level, on a grid of powers, each place once, in ascending order."""
    grid, found = np.geomspace(low, high, 400), list[float]()
    for f in functions:
        values = np.array([float(f(x, *others)) for x in grid.tolist()])
        for level in levels:
            above = values > level
            for k in np.flatnonzero((above[1:] != above[:-1]) & np.isfinite(values[1:] + values[:-1])).tolist():
                found.append(root(partial(_over, f, others, level), float(grid[k]), float(grid[k + 1])))
    found.sort()
    return [x for k, x in enumerate(found) if k == 0 or x > (1.0 + 1e-9) * found[k - 1]]


def _over(f: Callable, others: tuple[Any, ...], level: float, x: float) -> float:
    return float(f(x, *others)) - level
