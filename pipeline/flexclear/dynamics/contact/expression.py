"""Expressions of contact laws as functions of numbers that may be symbols (`scene.law_expressions`)."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from typing import Any

import numpy as np

from flexclear.dynamics.contact.restitution import root
from flexclear.dynamics.specialise.symbols import cos, exp, larger, log, sin, smaller, sqrt, tan, tanh
from flexclear.scene.expression import BENT, OPERANDS, fold
from flexclear.scene.formulas import WHOLE

OPERATIONS: dict[str, Callable[..., Any]] = {
    **{"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "^": operator.pow},
    **{"max": larger, "min": smaller, "minus": operator.neg, "abs": abs, "norm": abs},
    **{"sqrt": sqrt, "sin": sin, "cos": cos, "exp": exp, "log": log, "tan": tan, "tanh": tanh},
}


class Laws(dict[str, Any]):
    """Laws by name; those of expressions follow from their text."""

    def __init__(self, named: dict[str, Any], of_expression: Callable[[str], Any]) -> None:
        super().__init__(named)
        self._of_expression = lru_cache(of_expression)

    def __missing__(self, kind: str) -> Any:
        if not kind.startswith("expression,"):
            raise KeyError(kind)
        return self._of_expression(kind)


def composed(kind: str, bends: list[Callable] | None = None) -> Callable:
    """Return the function (a, b, c, values) of an expression of up to three variables.

    bends: receives functions of values at whose zeros its slope jumps.
    """

    def apply(token: str, given: list[Callable]) -> Callable:
        if bends is not None and token in BENT:
            bends.append(_applied(operator.sub, *given) if len(given) == 2 else given[0])
        if token[0] == "^" and token[1:]:
            return _applied(_power(float(token[1:])), *given)
        return _applied(OPERATIONS[token], *given)

    return fold(kind.split(",")[1:], _leaf, apply, _operands)


def _operands(token: str) -> int:
    return 1 if token[0] == "^" and token[1:] else OPERANDS.get(token, 0)


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


def zeros(functions: Iterable[Callable], low: float, high: float, *others: Any) -> list[float]:
    """Return the sign changes of f(x, *others) of functions on a grid of powers, each once, in ascending order."""
    grid, found = np.geomspace(low, high, 400).tolist(), list[float]()
    for f in functions:
        signs = [f(x, *others) > 0.0 for x in grid]
        pairs = zip(grid[:-1], grid[1:], signs[:-1], signs[1:], strict=True)
        found += [root(partial(_at, f, others), a, b) for a, b, before, after in pairs if before != after]
    found.sort()
    return [x for k, x in enumerate(found) if k == 0 or x > (1.0 + 1e-9) * found[k - 1]]


def _at(f: Callable, others: tuple[Any, ...], x: float) -> float:
    return float(f(x, *others))
