"""What is observed of rows of the record, their loops closed; also in singular poses, as a limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.numerics.rotations import continued
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations import observation
from flexclear.pipeline.dynamics.equations.observation import Blocks, Frames, Observed
from flexclear.pipeline.dynamics.integrate.recording import record_share
from flexclear.pipeline.dynamics.run.engine import Engine

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.run.collocation import Collocation

#: no row is projected to less than this fraction of the mechanism's size
ROUNDING = 1e-14
#: pivot ratios of the closures at which the equations hold eight digits of accelerations where loops are closed to
#: 1e-14, and six, with which a row must do in whose own pose they hold nothing
CLEAR, NEARLY_CLEAR = 1e-4, 1e-6
#: first distance in time from a singular pose, as fraction of the polynomial over it, its factor from try to try, and
#: how many tries there are
NEAREST, WIDER, TRIES = 1e-4, 2.0, 11
#: where the state is evaluated, in units of the distance, and the weights there of the limit between: exact for
#: quintics
SIDES, WEIGHTS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]), np.array([1.0, -6.0, 15.0, 15.0, -6.0, 1.0]) / 20.0


def observe(engine: Engine, rows: np.ndarray, *, after: bool = False) -> Observed:
    """What is recorded of rows of the record, whose states are projected first.

    On a break the laws hold as before it, or as `after` it.
    """
    return observation.by_name(observe_blocks(engine, rows, after=after), engine.model.arrays.size)


def observe_blocks(engine: Engine, rows: np.ndarray, *, after: bool = False) -> Blocks:
    """The same as the kernel writes it; see `equations.observation.by_name`."""
    pieces = engine.pieces[engine.segments(rows[:, 0], after=after)]
    return observe_with(engine, rows, pieces, max(record_share(engine.rtol) * engine.rtol, ROUNDING))


def frames(engine: Engine, rows: np.ndarray) -> Frames:
    """The frames of links and sites in rows of the record, whose loops are as open as the run left them."""
    size = engine.model.arrays.size
    pieces = engine.pieces[engine.segments(rows[:, 0], after=False)]
    whole, blocks = observation.room(len(rows), size, frames=True)
    _observe(engine, rows, pieces, observation.AS_RECORDED, whole)
    return observation.frames_by_name(blocks, size)


def observe_with(engine: Engine, rows: np.ndarray, pieces: np.ndarray, fraction: float) -> Blocks:
    """The same with given pieces of the laws, (rows, laws), projected to a fraction of the mechanism's size."""
    whole, blocks = observation.room(len(rows), engine.model.arrays.size)
    _observe(engine, rows, pieces, fraction * engine.model.length, whole)
    return blocks


def _observe(engine: Engine, rows: np.ndarray, pieces: np.ndarray, tolerance: float, out: np.ndarray) -> None:
    arrays = engine.model.arrays
    engine.entry.observe(
        engine.h,
        arrays.f,
        engine.w,
        engine.n,
        np.ascontiguousarray(rows),
        np.ascontiguousarray(pieces).reshape(len(rows), arrays.size(m.N_LAWS)),
        tolerance,
        out,
    )


def blurred(engine: Engine, row: np.ndarray, clear: float = CLEAR) -> bool:
    """Whether a row of the record is so close to a singular pose that its accelerations and forces are rounding."""
    one = m.record(row[None], len(engine.model.contacts))
    seen = engine.attempt(one.state[0], float(one.time[0]))
    return not seen or float(engine.view(m.PIVOT)[m.LAST_PIVOT]) < clear


def observe_around(engine: Engine, row: np.ndarray, motion: Collocation, clear: float) -> Blocks | None:
    """What is observed of such a row: the limit from both sides, of each block one row; None without one.

    In the pose the closures' multipliers are not unique, and a smooth motion makes them continuous across it: the mean
    of both sides, at a distance and at twice and thrice that, is but its sixth power from their value.  The states
    there are those of the polynomial motion, which is also taken a little beyond its ends, under the laws that hold
    between them.
    clear: pivot ratio of the closures that the sides must have.
    """
    pieces = np.tile(engine.pieces[engine.segments(0.5 * (motion.start + motion.end), after=True)], (len(SIDES), 1))
    for k in range(TRIES):
        rows = np.tile(row, (len(SIDES), 1))
        rows_around = m.record(rows, len(engine.model.contacts))
        rows_around.time[:] += NEAREST * motion.span * WIDER**k * SIDES
        rows_around.state[:] = motion.states(rows_around.time)
        if not any(blurred(engine, side, clear) for side in rows):
            seen = observe_with(engine, rows, pieces, ROUNDING)
            if not np.any(seen["status"]):
                turned = seen["body_quaternion"].reshape(len(SIDES), -1, 4)
                seen["body_quaternion"] = continued(turned).reshape(len(SIDES), -1)
                limit = {name: WEIGHTS @ block for name, block in seen.items()}
                mean = limit["body_quaternion"].reshape(-1, 4)
                limit["body_quaternion"] = (mean / np.linalg.norm(mean, axis=1, keepdims=True)).ravel()
                return limit
    return None
