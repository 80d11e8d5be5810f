"""Piecewise cubics behind an index that is known only when the code runs: the interval of a number, value and slope."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.specialise.symbols import Indexed, select

#: lower bound of an interval that does not exist
NOWHERE = 1e300


def interval(numbers: Indexed, first: int, levels: int, x: Any) -> Any:
    """Return the number of the interval that contains x, of those whose lower bounds begin at `first`."""
    k: Any = 0
    for level in reversed(range(levels)):
        step = 1 << level
        k = k + select(numbers[first + k + step] <= x, step, 0)
    return k


def cubic(numbers: Indexed, at: Any, s: Any) -> Any:
    """Return a cubic whose coefficients begin at `at`."""
    c0, c1, c2, c3 = (numbers[at + k] for k in range(4))
    return c0 + s * (c1 + s * (c2 + s * c3))


def slope(numbers: Indexed, at: Any, s: Any) -> Any:
    """Return the slope of a cubic whose coefficients begin at `at`."""
    return numbers[at + 1] + s * (2.0 * numbers[at + 2] + 3.0 * s * numbers[at + 3])
