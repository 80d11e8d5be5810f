"""States of an engine: as rows of the record, and displaced a little from its start as drives and loops allow it.

Displacements follow from the rates at speeds, less those at the speeds of the drives alone: no step width enters.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics.integrate import recording
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import project, rates_at_speeds


def rows_of(
    engine: Engine,
    states: np.ndarray,
    time: float | np.ndarray,
    modes: float | np.ndarray = 0.0,
    latched: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Rows of the record for states, shape (rows, NY), at a time or times [s].

    modes, latched: of the contacts, shape (contacts,), or one for all: open, without an impact rate.
    """
    contacts = len(engine.model.contacts)
    rows = recording.empty_record(len(states), contacts, engine.model.ny)
    made = recording.record(rows, contacts)
    made.time[:], made.modes[:], made.latched[:], made.state[:] = time, modes, latched, states
    return rows


def per_speed(engine: Engine, y: np.ndarray, read: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Change of what is read of the rates, or of the work space, per unit of each free speed; shape (..., nv)."""
    nv = engine.model.nv
    driven = read(rates_at_speeds(engine, y, np.zeros(nv)))
    changes = [read(rates_at_speeds(engine, y, unit)) - driven for unit in np.eye(nv)]
    return np.moveaxis(np.reshape(changes, (nv, *np.shape(driven))), 0, -1)


def displaced(engine: Engine, y: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """The state after a small displacement by the free coordinates, shape (nv,), its loops closed."""
    there, nq = y.copy(), engine.model.nq
    there[:nq] += rates_at_speeds(engine, y, displacement)[:nq] - rates_at_speeds(engine, y, 0.0 * displacement)[:nq]
    return project(engine, there)


def askew(count: int) -> np.ndarray:
    """Numbers from -1 to 1 that make a direction which no symmetry of a mechanism has, shape (count,)."""
    return np.asarray(np.sin(1.0 + np.arange(count) * 2.399963))
