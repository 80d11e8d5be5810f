"""What is observed of rows of the record, their loops closed; also in singular poses, as a limit."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.equations import observation
from pipeline.dynamics.equations.observation import Observed
from pipeline.dynamics.run.engine import Engine, pieces_at

#: recorded states are projected to this share of rtol times the mechanism's size, and at least to rounding
RECORD_SHARE, ROUNDING = 1e-3, 1e-14
#: first distance in time from a singular pose, as share of the run, and its factor from try to try
NEAREST, WIDER = 1e-8, 4.0
#: pivot ratio of the closures at which the equations hold six digits
CLEAR = 1e-6
#: where it is looked, in units of the distance, and the weights there of the limit between: exact for cubics
SIDES, WEIGHTS = np.array([-2.0, -1.0, 1.0, 2.0]), np.array([[-1.0, 4.0, 4.0, -1.0]]) / 6.0
#: tries, the last of which is some share of 1e-2 of the run away
TRIES = 11


def observe(engine: Engine, rows: np.ndarray, *, after: bool = False) -> Observed:
    """What is recorded of rows of the record, whose states are projected first.

    On a break the laws hold as before it, or as `after` it.
    """
    return observation.by_name(observe_flat(engine, rows, after=after), engine.model.arrays.size)


def observe_flat(engine: Engine, rows: np.ndarray, *, after: bool = False) -> np.ndarray:
    """The same as the kernel writes it, shape (rows, columns); see `equations.observation.by_name`."""
    arrays, segments = engine.model.arrays, engine.breaks
    sides = np.clip(np.searchsorted(segments, rows[:, 0], side="right" if after else "left"), 1, len(segments) - 1)
    middles = 0.5 * (segments[sides - 1] + segments[sides])
    per_segment = {x: pieces_at(engine.model, x) for x in set(middles.tolist())}
    pieces = np.array([per_segment[x] for x in middles.tolist()], dtype=np.int64)
    tolerance = max(RECORD_SHARE * engine.rtol, ROUNDING) * engine.model.length
    out = observation.room(len(rows), arrays.size)
    engine.entry.observe(
        engine.h,
        arrays.f,
        engine.w,
        engine.n,
        np.ascontiguousarray(rows),
        pieces.reshape(len(rows), arrays.size(m.N_LAWS)),
        tolerance,
        out,
    )
    return out


def beside(engine: Engine, row: np.ndarray) -> np.ndarray | None:
    """What is observed of a row whose pose is singular: the limit from both sides, shape (columns,); None without one.

    In the pose the closures' multipliers are not unique, and a smooth motion makes them continuous across it: the mean
    of both sides, at a distance and at twice that, is but its fourth power from their value.  The states there follow
    from the row's velocities and the closures.  Before the run's start all laws are as just after it.
    """
    nq, contacts = engine.model.nq, len(engine.model.contacts)
    t, y = float(row[0]), m.record(row[None], contacts).state[0]
    engine.attempt(y, t)
    rate = engine.slope[:nq].copy()
    distance = NEAREST * (engine.end - engine.start)
    for _ in range(TRIES):
        away = distance * SIDES
        rows = np.tile(row, (len(away), 1))
        near = m.record(rows, contacts)
        near.time[:] += away
        near.state[:, :nq] += np.outer(away, rate)
        inside = (t == engine.start or engine.start < near.time.min()) and near.time.max() < engine.end
        if inside and _clear(engine, near):
            out = observe_flat(engine, rows)
            if not np.any(observation.by_name(out, engine.model.arrays.size).status):
                return (WEIGHTS @ out)[0]
        distance *= WIDER
    return None


def _clear(engine: Engine, rows: m.Record) -> bool:
    """Whether the closures are well apart from singular in all rows."""
    pivots = engine.view(m.PIVOT)
    states = zip(rows.state, rows.time, strict=True)
    return all(engine.attempt(y, float(t)) and pivots[m.LAST_PIVOT] > CLEAR for y, t in states)
