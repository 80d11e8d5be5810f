r"""Tables in expressions of loads: the pieces of a spline, and the kernels that look one up.

The numbers of a table over one quantity with n halvings of its intervals: its upper bound, :math:`2^n` lower bounds of
intervals, unused ones infinite, and four coefficients of each interval. Over two: both upper bounds, the lower bounds
of each, and sixteen coefficients of each cell, those of the second quantity after one another.
Source: de Boor (1978), A Practical Guide to Splines, ch. IV and XVII (tensor products; by SciPy).
"""

from __future__ import annotations

from math import prod

import numpy as np

from flexclear.dynamics.kernels import kernel
from flexclear.scene.tables import LookupTable

#: fraction of a table's range by which rounding may pass its ends
ROUNDING = 1e-9
#: lower bound of an interval that does not exist
NOWHERE = 1e300


def length(levels: tuple[int, ...]) -> int:
    """Return how many numbers a table has with these halvings."""
    sizes = [2**n for n in levels]
    return len(levels) + sum(sizes) + 4 ** len(levels) * prod(sizes)


def numbers(table: LookupTable) -> list[float]:
    """Return the numbers of a table, as the kernels read them."""
    axes, sizes = [np.array(axis) for axis in table.axes()], [2**n for n in table.levels()]
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


@kernel
def onward(d, at, step, x):
    """Return the step where the number a step further is at most x, else 0."""
    if d.load_numbers[at + step].value <= x:
        return step
    return 0


@kernel
def interval(d, first, levels, x):
    """Return the number of the interval that contains x, of those whose lower bounds begin at `first`."""
    k = 0
    for level in range(levels):
        k = k + onward(d, first + k, 1 << (levels - 1 - level), x)
    return k


@kernel
def within(d, first, upper, x, value):
    """Return a value, not a number where x is outside of the table: this ends the run."""
    low, high = d.load_numbers[first].value, d.load_numbers[upper].value
    inside = min(x - low, high - x) + ROUNDING * (high - low)
    if inside < 0.0:
        return np.sqrt(inside)
    return value


@kernel
def cubic(d, at, s):
    """Return a cubic whose coefficients begin at `at`."""
    c0, c1 = d.load_numbers[at].value, d.load_numbers[at + 1].value
    return c0 + s * (c1 + s * (d.load_numbers[at + 2].value + s * d.load_numbers[at + 3].value))


@kernel
def curve(d, k, first, n, x):
    """Return the value at x of a table over one quantity, whose numbers begin at the first-th of load k."""
    upper = d.loads[k].number0 + first
    bounds = upper + 1
    i = interval(d, bounds, n, x)
    value = cubic(d, bounds + (1 << n) + 4 * i, x - d.load_numbers[bounds + i].value)
    return within(d, bounds, upper, x, value)


@kernel
def surface(d, k, first, n, m, x, y):
    """Return the value at x and y of a table over two quantities, whose numbers begin at the first-th of load k."""
    upper = d.loads[k].number0 + first
    along = upper + 2
    across = along + (1 << n)
    i, j = interval(d, along, n, x), interval(d, across, m, y)
    s, r = x - d.load_numbers[along + i].value, y - d.load_numbers[across + j].value
    at = across + (1 << m) + 16 * ((1 << m) * i + j)
    value = cubic(d, at, r) + s * (cubic(d, at + 4, r) + s * (cubic(d, at + 8, r) + s * cubic(d, at + 12, r)))
    return within(d, along, upper, x, within(d, across, upper + 1, y, value))
