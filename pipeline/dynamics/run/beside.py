"""What is observed in a singular pose itself: the limit of what is seen just before and just after it."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.run.collocation import CLOSELY, Collocation
from pipeline.dynamics.run.engine import Engine, observe_with, pieces_at

#: pivot ratio of the closures at which the equations hold eight digits of accelerations where loops are closed to 1e-14
CLEAR = 1e-4
#: first distance in time, as share of the polynomial, its factor from try to try, and how many there are
NEAREST, WIDER, TRIES = 1e-4, 2.0, 11
#: where it is looked, in units of the distance, and the weights there of the limit between: exact for quintics
SIDES, WEIGHTS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]), np.array([[1.0, -6.0, 15.0, 15.0, -6.0, 1.0]]) / 20.0


def blurred(engine: Engine, row: np.ndarray) -> bool:
    """Whether a recorded row is so near to a singular pose that its accelerations and forces are rounding."""
    seen = engine.attempt(row[1 + 2 * len(engine.model.mechanism.contacts) :], float(row[0]))
    return not seen or float(engine.view(m.PIVOT, m.PIVOT_SIZE)[m.LAST_PIVOT]) < CLEAR


def beside(engine: Engine, row: np.ndarray, motion: Collocation) -> dict[str, np.ndarray] | None:
    """Observed fields of such a row, shape (1, width) each; None when there are none.

    In the pose the closures' multipliers are not unique, and a smooth motion makes them continuous across it: the mean
    of both sides, at a distance and at twice and thrice that, is but its sixth power from their value.  The states
    there are those of the polynomial motion, which is also taken a little beyond its ends, under the laws that hold
    between them.
    """
    first = 1 + 2 * len(engine.model.mechanism.contacts)
    pieces = np.tile(pieces_at(engine.model, 0.5 * (motion.start + motion.end)), (len(SIDES), 1))
    distance = NEAREST * motion.span
    for _ in range(TRIES):
        rows = np.tile(row, (len(SIDES), 1))
        rows[:, 0] += distance * SIDES
        rows[:, first:] = motion.states(rows[:, 0])
        if not any(blurred(engine, side) for side in rows):
            seen = observe_with(engine, rows, pieces, CLOSELY)
            if not np.any(seen["status"]):
                return {name: WEIGHTS @ values for name, values in seen.items()}
        distance *= WIDER
    return None
