"""Rows of the record from states, and outputs observed from rows with their loops closed."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations import observation
from flexclear.dynamics.equations.observation import Blocks, Observed
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.run.evaluation.engine import Engine

#: least tolerance of the projection of rows, as a fraction of the mechanism's size
ROUNDING = 1e-14


def rows_of(
    engine: Engine,
    states: np.ndarray,
    time: float | np.ndarray,
    modes: float | np.ndarray = 0.0,
    latched: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Return rows of the record for states, shape (rows, NY), at a time or times [s].

    modes, latched: of the contacts, shape (contacts,), or one number for all; default open, without an impact rate.
    """
    contacts = len(engine.model.contacts)
    rows = recording.empty_record(len(states), contacts, states.shape[1])
    made = recording.record(rows, contacts)
    made.time[:], made.modes[:], made.latched[:], made.state[:] = time, modes, latched, states
    return rows


def observe(engine: Engine, rows: np.ndarray, *, after: bool = False) -> Observed:
    """Return the outputs at rows of the record, whose states are projected first.

    On a break the laws before it hold, or those `after` it.
    """
    return observation.by_name(observe_blocks(engine, rows, after=after), engine.model.arrays.size)


def observe_blocks(engine: Engine, rows: np.ndarray, *, after: bool = False) -> Blocks:
    """Return the outputs as `observe` stores them; see `equations.observation.by_name`."""
    pieces = engine.pieces[engine.segments(rows[:, 0], after=after)]
    return observe_with(engine, rows, pieces, max(recording.record_share(engine.rtol) * engine.rtol, ROUNDING))


def frames(engine: Engine, rows: np.ndarray) -> np.ndarray:
    """Return LINK_FRAMES without accelerations in rows of the record, without projection; (rows, links)."""
    pieces = engine.pieces[engine.segments(rows[:, 0], after=False)]
    whole, blocks = observation.room(len(rows), engine.model.arrays.size, frames=True)
    engine.observe(rows, pieces, observation.AS_RECORDED, whole)
    return m.named(m.LINK_FRAMES, blocks["links"])


def observe_with(engine: Engine, rows: np.ndarray, pieces: np.ndarray, fraction: float) -> Blocks:
    """Return the outputs for given pieces of laws, (rows, laws), projected to a fraction of the mechanism's size."""
    whole, blocks = observation.room(len(rows), engine.model.arrays.size)
    engine.observe(rows, pieces, fraction * engine.model.length, whole)
    return blocks
