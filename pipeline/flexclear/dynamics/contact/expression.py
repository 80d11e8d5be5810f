"""Expressions of contact laws as kernels, composed of one kernel per operation (`scene.law_expressions`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from typing import Any

import numpy as np

from flexclear.dynamics.contact.restitution import root
from flexclear.dynamics.kernels import kernel
from flexclear.scene.expression import BENT, OPERANDS, fold
from flexclear.scene.formulas import WHOLE

VARIABLES = (kernel(lambda a, b, c, p: a), kernel(lambda a, b, c, p: b), kernel(lambda a, b, c, p: c))
OPERATIONS: dict[str, Callable] = {
    "+": kernel(lambda x, y: x + y),
    "-": kernel(lambda x, y: x - y),
    "*": kernel(lambda x, y: x * y),
    "/": kernel(lambda x, y: x / y),
    "^": kernel(lambda x, y: x**y),
    "max": kernel(lambda x, y: max(x, y)),
    "min": kernel(lambda x, y: min(x, y)),
    "minus": kernel(lambda x: -x),
    "abs": kernel(lambda x: abs(x)),
    "norm": kernel(lambda x: abs(x)),
    "sqrt": kernel(lambda x: np.sqrt(x)),
    "sin": kernel(lambda x: np.sin(x)),
    "cos": kernel(lambda x: np.cos(x)),
    "tan": kernel(lambda x: np.tan(x)),
    "exp": kernel(lambda x: np.exp(x)),
    "log": kernel(lambda x: np.log(x)),
    "tanh": kernel(lambda x: np.tanh(x)),
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
    """Return the kernel (a, b, c, values) of an expression of up to three variables.

    bends: receives the kernels of values at whose zeros its slope jumps.
    """

    def apply(token: str, given: list[Callable]) -> Callable:
        if bends is not None and token in BENT:
            bends.append(_two(OPERATIONS["-"], *given) if len(given) == 2 else given[0])
        if token[0] == "^" and token[1:]:
            return _one(_power(float(token[1:])), *given)
        return (_two if len(given) == 2 else _one)(OPERATIONS[token], *given)

    return fold(kind.split(",")[1:], _leaf, apply, _operands)


def _operands(token: str) -> int:
    return 1 if token[0] == "^" and token[1:] else OPERANDS.get(token, 0)


def _leaf(token: str) -> Callable:
    if token[0] == "x":
        return VARIABLES[int(token[1:])]
    index, value = (int(token[1:]), 0.0) if token[0] == "c" else (-1, float(token))

    @kernel
    def named(a, b, c, p):
        return p[index]

    @kernel
    def number(a, b, c, p):
        return value

    return number if index < 0 else named


def _one(operation: Callable, first: Callable) -> Callable:
    @kernel
    def applied(a, b, c, p):
        return operation(first(a, b, c, p))

    return applied


def _two(operation: Callable, first: Callable, second: Callable) -> Callable:
    @kernel
    def applied(a, b, c, p):
        return operation(first(a, b, c, p), second(a, b, c, p))

    return applied


def _power(exponent: float) -> Callable:
    """Return the kernel of a power, by products and a root where these suffice."""
    whole, half, inverse = int(abs(exponent)), abs(exponent) % 1.0 == 0.5, exponent < 0.0
    if not (whole <= WHOLE and 2.0 * exponent == int(2.0 * exponent)):
        return kernel(lambda x: x**exponent)

    @kernel
    def power(x):
        y = 1.0
        for _ in range(whole):
            y = y * x
        if half:
            y = y * np.sqrt(x)
        return 1.0 / y if inverse else y

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
