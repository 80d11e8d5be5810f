"""Dual numbers with changes along several directions: routines run on them give exact derivatives without a compiler.

Every number that depends on a changed one carries its derivatives. Routines run in Python, so iterations are
differentiated too, and no mechanism is too large. A run takes some microseconds per operation for all directions
together; where one mechanism is differentiated thousands of times, compiled tangents (`derivative`) are faster.

Source: Griewank & Walther, *Evaluating Derivatives*, 2nd ed. (2008), sec. 3.1 (vector mode) and 6.1 (by overloading).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from flexclear.dynamics.specialise.rules import RULES


def _comparison(compare: Callable) -> Callable[[Any, Any], bool]:
    return lambda self, other: bool(compare(self.value, value(other)))


class Dual:
    """A number and its changes along all directions, shape (directions,)."""

    __slots__ = ("change", "value")
    __hash__ = None  # type: ignore[assignment]
    __array_ufunc__ = None  # NumPy's numbers leave operations with a Dual to the Dual

    def __init__(self, value: Any, change: Any) -> None:
        self.value, self.change = value, change

    def __add__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.change + other.change)
        return Dual(self.value + other, self.change)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value - other.value, self.change - other.change)
        return Dual(self.value - other, self.change)

    def __rsub__(self, other: Any) -> Dual:
        return Dual(other - self.value, -self.change)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Dual):
            return Dual(self.value * other.value, self.change * other.value + other.change * self.value)
        return NotImplemented if isinstance(other, tuple) else Dual(self.value * other, self.change * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            quotient = self.value / other.value
            return Dual(quotient, (self.change - quotient * other.change) / other.value)
        return Dual(self.value / other, self.change / other)

    def __rtruediv__(self, other: Any) -> Dual:
        quotient = other / self.value
        return Dual(quotient, -quotient / self.value * self.change)

    def __pow__(self, other: Any) -> Any:
        return self * self if not isinstance(other, Dual) and other == 2 else _apply("pow", operator.pow, self, other)

    def __rpow__(self, other: Any) -> Any:
        return _apply("pow", operator.pow, other, self)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.change)

    def __abs__(self) -> Dual:
        return -self if self.value < 0.0 else self

    __lt__, __le__ = _comparison(operator.lt), _comparison(operator.le)
    __gt__, __ge__ = _comparison(operator.gt), _comparison(operator.ge)
    __eq__ = _comparison(operator.eq)


def value(number: Any) -> Any:
    """Return a number without its changes."""
    return number.value if isinstance(number, Dual) else number


class _Numbers:
    """Evaluates operations on numbers, for `RULES`; a tape records them."""

    add, subtract, multiply = operator.add, operator.sub, operator.mul
    divide, negate = operator.truediv, operator.neg

    @staticmethod
    def select(condition: Any, a: Any, b: Any) -> Any:
        return a if condition else b

    @staticmethod
    def write(kind: str, operation: str, *arguments: Any) -> Any:
        return np.power(*arguments) if operation == "pow" else getattr(np, operation)(*arguments)


def function_of(name: str, *arguments: Any) -> Any:
    """Return NumPy's function of this name of numbers."""
    return _apply(name, getattr(np, name), *arguments)


def _apply(name: str, function: Callable, *arguments: Any) -> Any:
    """Return a function of numbers, with changes where an argument has some."""
    if not any(isinstance(a, Dual) for a in arguments):
        return function(*arguments)
    values = tuple(map(value, arguments))
    result = function(*values)
    changes = tuple(a.change if isinstance(a, Dual) else 0.0 for a in arguments)
    change = RULES[name](_Numbers, result, values, changes)
    return Dual(result, change) if isinstance(change, np.ndarray) else result


def seed_changes(values: np.ndarray, changes: np.ndarray) -> list[Any]:
    """Return an array's numbers with their changes, shape (directions, len(values)); plain where all are zero."""
    moving = np.any(changes != 0.0, axis=0).tolist()
    return [Dual(v, changes[:, k].copy()) if moving[k] else v for k, v in enumerate(values)]


def changes(numbers: Iterable[Any], directions: int) -> np.ndarray:
    """Return the changes of numbers, shape (directions, len(numbers))."""
    nothing = np.zeros(directions)
    rows = [number.change if isinstance(number, Dual) else nothing for number in numbers]
    return np.array(rows).reshape(len(rows), directions).T.copy()


def product(matrix: Any, vector: Iterable[Any]) -> list[Any]:
    """Return the product of a matrix of plain numbers with numbers that may carry changes."""
    given = list(vector)
    values = list(matrix @ np.array([value(one) for one in given], dtype=matrix.dtype))
    directions = next((len(one.change) for one in given if isinstance(one, Dual)), 0)
    if not directions:
        return values
    return [Dual(*one) for one in zip(values, matrix @ changes(given, directions).T, strict=True)]
