"""Tables of loads, whose pieces are found when the code runs; `loads.lookup` has their numbers."""

from __future__ import annotations

from math import nan
from typing import Any

from flexclear.dynamics.loads.lookup import ROUNDING
from flexclear.dynamics.routines.calls import Indexed
from flexclear.dynamics.routines.symbols import select, smaller


def curve(numbers: Indexed, n: int, x: Any) -> Any:
    """Return the value at x of a table over one quantity with n halvings of its intervals."""
    i = interval(numbers, 1, n, x)
    value = cubic(numbers, 1 + (1 << n) + 4 * i, x - numbers[1 + i])
    return within(numbers, 1, 0, x, value)


def surface(numbers: Indexed, n: int, m: int, x: Any, y: Any) -> Any:
    """Return the value at x and y of a table over two quantities."""
    along, across = 2, 2 + (1 << n)
    i, j = interval(numbers, along, n, x), interval(numbers, across, m, y)
    s, r = x - numbers[along + i], y - numbers[across + j]
    at = across + (1 << m) + 16 * ((1 << m) * i + j)
    c0, c1, c2, c3 = (cubic(numbers, at + 4 * k, r) for k in range(4))
    value = c0 + s * (c1 + s * (c2 + s * c3))
    return within(numbers, along, 0, x, within(numbers, across, 1, y, value))


def interval(numbers: Indexed, first: int, levels: int, x: Any) -> Any:
    """Return the number of the interval that contains x, of those whose lower bounds begin at `first`."""
    k: Any = 0
    for level in reversed(range(levels)):
        step = 1 << level
        k = k + select(numbers[first + k + step] <= x, step, 0)
    return k


def within(numbers: Indexed, first: int, upper: int, x: Any, value: Any) -> Any:
    """Return a value, not a number where x is outside of the table: this ends the run."""
    low, high = numbers[first], numbers[upper]
    return select(smaller(x - low, high - x) + ROUNDING * (high - low) < 0.0, nan, value)


def cubic(numbers: Indexed, at: Any, s: Any) -> Any:
    """Return a cubic whose coefficients begin at `at`."""
    c0, c1, c2, c3 = (numbers[at + k] for k in range(4))
    return c0 + s * (c1 + s * (c2 + s * c3))
