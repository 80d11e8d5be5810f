r"""Derivatives along a line by extrapolated central differences.

Forces of one mechanism change over lengths from a millimetre (gravity, springs) to a nanometre (a contact that is
just closed), so no step width fits all. Steps shrink geometrically from far too large to far too small, and the entry
of the extrapolation table with the smallest estimated error is taken (Ridders): truncation has died out there, and
rounding, which grows as 1/step, has not begun.

Source: Ridders (1982), Advances in Engineering Software 4(2), 75-76; Press et al., *Numerical Recipes*, sec. 5.7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexclear.pipeline.core.system.errors import SolverError

#: each step is this many times shorter than the one before; 22 of them span nine orders of magnitude
FACTOR, LEVELS = 2.5, 22
#: columns of the table: error orders 2, 4, .. 10
ORDERS = 5
#: steps of the probe of rounding, as fractions of the widest: many roundings of a coordinate of its size, and so short
#: that a contact closed by a nanometre changes its slope by 1e-5
PROBE = 1e-12 * np.arange(-3, 4)


@dataclass(frozen=True)
class Rounding:
    """What a force cannot resolve. noise: of its value, in its unit.  grain: of the variable s."""

    noise: float = 0.0
    grain: float = 0.0


def derivative(force: Callable[[float], np.ndarray], widest: float, rounding: Rounding) -> tuple[np.ndarray, float]:
    """Derivative d force / d s at s = 0, and the estimate of its error in the Euclidean norm.

    force(s): shape (n,); it may raise SolverError where it does not exist, which steps inward.
    widest: the largest step tried.  Raises SolverError when `force` exists nowhere close by.
    """
    noise = max(rounding.noise, _noise(force, widest))
    steps = widest / FACTOR ** np.arange(LEVELS)
    table = [_row(force, float(step)) for step in steps]
    for above, row in pairwise(table):
        for j in range(min(len(above), ORDERS) if row else 0):
            gain = FACTOR ** (2 * (j + 1))
            row.append((gain * row[j] - above[j]) / (gain - 1.0))
    best: tuple[np.ndarray, float] | None = None
    for step, above, row in zip(steps[1:], table, table[1:], strict=False):
        # differences alone deceive where rounding makes neighbours equal by chance
        floor = (noise + rounding.grain * float(np.linalg.norm(row[0]))) / step if row else 0.0
        for j in range(1, min(len(above) + 1, len(row))):
            change = max(np.linalg.norm(row[j] - row[j - 1]), np.linalg.norm(row[j] - above[j - 1]))
            if best is None or float(change) + floor < best[1]:
                best = row[j], float(change) + floor
    if best is None:
        raise SolverError("the forces close to this pose cannot be evaluated")
    return best


def _noise(force: Callable[[float], np.ndarray], widest: float) -> float:
    """What rounding does to the force: its scatter about a straight line over very short steps.

    Terms that balance leave nothing of their size in the force, only their rounding.
    """
    try:
        values = np.array([force(float(widest * step)) for step in PROBE])
    except SolverError:
        return 0.0
    line = np.stack([np.ones(len(PROBE)), PROBE / PROBE[-1]], axis=1)
    left = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    return float(np.linalg.norm(left)) / np.sqrt(len(PROBE) - 2)


def _row(force: Callable[[float], np.ndarray], step: float) -> list[np.ndarray]:
    """A row of the table with its first entry, or an empty one."""
    try:
        return [(force(step) - force(-step)) / (2.0 * step)]
    except SolverError:
        return []
