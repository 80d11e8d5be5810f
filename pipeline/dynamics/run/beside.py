"""What is observed in a singular pose itself: the limit of what is seen just before and just after it."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.run.engine import Engine, observe

#: first distance in time, as share of the run, and its factor from try to try
NEAREST, WIDER = 1e-8, 4.0
#: pivot ratio of the closures at which the equations hold six digits
CLEAR = 1e-6
#: where it is looked, in units of the distance, and the weights there of the limit between: exact for cubics
SIDES, WEIGHTS = np.array([-2.0, -1.0, 1.0, 2.0]), np.array([[-1.0, 4.0, 4.0, -1.0]]) / 6.0
#: tries, the last of which is some share of 1e-2 of the run away
TRIES = 11


def beside(engine: Engine, row: np.ndarray) -> dict[str, np.ndarray] | None:
    """Observed fields of a recorded row whose pose is singular, shape (1, width) each; None when there are none.

    In the pose the closures' multipliers are not unique, and a smooth motion makes them continuous across it: the mean
    of both sides, at a distance and at twice that, is but its fourth power from their value.  The states there follow
    from the row's velocities and the closures.  Before the run's start all laws are as just after it.
    """
    t, first = float(row[0]), 1 + 2 * len(engine.model.mechanism.contacts)
    y, nq = row[first:], engine.model.numbering.nq
    engine.attempt(y, t)
    rate = engine.view(m.SLOPES, len(y))[:nq].copy()
    distance = NEAREST * (engine.end - engine.start)
    for _ in range(TRIES):
        sides = distance * SIDES
        rows = np.tile(row, (len(sides), 1))
        rows[:, 0] += sides
        rows[:, first : first + nq] += np.outer(sides, rate)
        inside = (t == engine.start or engine.start < rows[:, 0].min()) and rows[:, 0].max() < engine.end
        if inside and _clear(engine, rows, first):
            seen = observe(engine, rows)
            if not np.any(seen["status"]):
                return {name: WEIGHTS @ values for name, values in seen.items()}
        distance *= WIDER
    return None


def _clear(engine: Engine, rows: np.ndarray, first: int) -> bool:
    """Whether the closures are well apart from singular in all rows."""
    pivots = engine.view(m.PIVOT, m.PIVOT_SIZE)
    return all(engine.attempt(row[first:], float(row[0])) and pivots[m.LAST_PIVOT] > CLEAR for row in rows)
