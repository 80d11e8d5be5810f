"""What is observed in a singular pose itself: the mean of what is seen just before and just after it."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.assembly.places import LAST_PIVOT, PIVOT_SIZE
from pipeline.dynamics.integrate.engine import Engine, observe

#: first distance in time, as share of the run, and its factor from try to try
NEAREST, WIDER = 1e-8, 4.0
#: pivot ratio of the closures at which the equations hold six digits
CLEAR = 1e-6
#: tries, the last of which is some share of 1e-2 of the run away
TRIES = 11


def beside(engine: Engine, row: np.ndarray) -> dict[str, np.ndarray] | None:
    """Observed fields of a recorded row whose pose is singular, shape (1, width) each; None when there are none.

    In the pose the closures' multipliers are not unique, and a smooth motion makes them continuous across it: their
    value is the mean of both sides up to the square of the distance.  The states there follow from
    the row's velocities and the closures.
    """
    t, first = float(row[0]), 1 + 2 * len(engine.built.system.contacts)
    y, nq = row[first:], engine.built.layout.nq
    engine.attempt(y, t)
    rate = engine.view("SLOPES", len(y))[:nq].copy()
    distance = NEAREST * (engine.end - engine.start)
    for _ in range(TRIES):
        rows = np.stack([row, row])
        for line, side in zip(rows, (-distance, distance), strict=True):
            line[0] += side
            line[first : first + nq] += side * rate
        if engine.start < rows[0, 0] and rows[1, 0] < engine.end and _clear(engine, rows, first):
            seen = observe(engine, rows)
            if not np.any(seen["status"]):
                return {name: values.mean(axis=0, keepdims=True) for name, values in seen.items()}
        distance *= WIDER
    return None


def _clear(engine: Engine, rows: np.ndarray, first: int) -> bool:
    """Whether the closures are well apart from singular in all rows."""
    pivots = engine.view("PIVOT", PIVOT_SIZE)
    return all(engine.attempt(row[first:], float(row[0])) and pivots[LAST_PIVOT] > CLEAR for row in rows)
