r"""Tables in expressions of loads and of contact laws: the pieces of a spline, and how one is looked up.

The numbers of a table over one quantity with n halvings of its intervals: its upper bound, :math:`2^n` lower bounds of
intervals, unused ones infinite, and four coefficients of each interval. Over two: both upper bounds, the lower bounds
of each, and sixteen coefficients of each cell, those of the second quantity after one another.
Source: de Boor (1978), A Practical Guide to Splines, ch. IV and XVII (tensor products; by SciPy).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import nan, prod
from typing import Any

import numpy as np

from flexclear.dynamics.specialise.intervals import NOWHERE, cubic, interval
from flexclear.dynamics.specialise.symbols import select, smaller
from flexclear.scene.tables import LookupTable

#: fraction of a table's range by which rounding may pass its ends
ROUNDING = 1e-9


def length(levels: Sequence[int]) -> int:
    """Return how many numbers a table has with these halvings."""
    sizes = [2**n for n in levels]
    return len(levels) + sum(sizes) + 4 ** len(levels) * prod(sizes)


def numbers(table: LookupTable) -> list[float]:
    """Return the numbers of a table, as they are read."""
    axes, sizes = [np.array(axis) for axis in table.axes()], [2**n for n in table.halvings()]
    values = np.array(sorted(table.points))[:, -1].reshape([len(axis) for axis in axes])
    # coefficients of the pieces along each quantity in turn, ascending: (interval, power) in place of its values
    for k, axis in enumerate(axes):
        values = np.moveaxis(_pieces(axis, np.moveaxis(values, 2 * k, 0), table.between), (0, 1), (2 * k, 2 * k + 1))
    room = np.zeros([n for size in sizes for n in (size, 4)])
    room[tuple(slice(n) for n in values.shape)] = values
    starts = [
        np.concatenate([axis[:-1], np.full(size - len(axis) + 1, NOWHERE)])
        for axis, size in zip(axes, sizes, strict=True)
    ]
    cells = np.moveaxis(room, 2, 1) if len(axes) == 2 else room
    return [*(float(axis[-1]) for axis in axes), *np.concatenate(starts).tolist(), *cells.ravel().tolist()]


def _pieces(x: np.ndarray, y: np.ndarray, between: str) -> np.ndarray:
    """Return coefficients of the pieces between points, ascending, (interval, 4, ...); y: (points, ...)."""
    from scipy.interpolate import CubicSpline

    if between == "cubic":
        return np.asarray(np.moveaxis(CubicSpline(x, y).c[::-1], 1, 0))
    slope = np.diff(y, axis=0) / np.diff(x).reshape(-1, *[1] * (y.ndim - 1))
    return np.stack([y[:-1], slope, 0.0 * slope, 0.0 * slope], axis=1)


def curve(numbers: Any, n: int, x: Any) -> Any:
    """Return the value at x of a table over one quantity with n halvings of its intervals."""
    i = interval(numbers, 1, n, x)
    value = cubic(numbers, 1 + (1 << n) + 4 * i, x - numbers[1 + i])
    return within(numbers, 1, 0, x, value)


def surface(numbers: Any, n: int, m: int, x: Any, y: Any) -> Any:
    """Return the value at x and y of a table over two quantities."""
    along, across = 2, 2 + (1 << n)
    i, j = interval(numbers, along, n, x), interval(numbers, across, m, y)
    s, r = x - numbers[along + i], y - numbers[across + j]
    at = across + (1 << m) + 16 * ((1 << m) * i + j)
    c0, c1, c2, c3 = (cubic(numbers, at + 4 * k, r) for k in range(4))
    value = c0 + s * (c1 + s * (c2 + s * c3))
    return within(numbers, along, 0, x, within(numbers, across, 1, y, value))


def within(numbers: Any, first: int, upper: int, x: Any, value: Any) -> Any:
    """Return a value, not a number where x is outside of the table: this ends the run."""
    low, high = numbers[first], numbers[upper]
    return select(smaller(x - low, high - x) + ROUNDING * (high - low) < 0.0, nan, value)


def left(name: str, table: LookupTable, values: Sequence[float]) -> str | None:
    """Return in words which quantity of a table is outside of its points; None if none is."""
    one = table.function(name)
    for column, unit, axis, value in zip(table.of, one.of, table.axes(), values, strict=True):
        near = 0.5 * ROUNDING * (axis[-1] - axis[0])  # the last state that can be evaluated is farther out
        if not axis[0] - near <= value <= axis[-1] + near:
            what = column.column if isinstance(column.column, str) else f"column {column.column}"
            return (
                f"{what} = {value:.6g} {unit} leaves table {name} ({table.file}), whose "
                f"points are at {axis[0]:.6g} to {axis[-1]:.6g} {unit}; add points, or limit it by max and min"
            )
    return None


def at(numbers: Any, levels: Sequence[int], values: Sequence[Any]) -> Any:
    """Return the value of a table over one or two quantities."""
    return (curve, surface)[len(levels) - 1](numbers, *levels, *values)
