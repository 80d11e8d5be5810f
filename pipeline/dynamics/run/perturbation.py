"""Starts that differ by a hair: the balls of the clearance joints moved, the loops kept closed."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.run.engine import Engine, project


def offset_jacobian(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Change of the ball-to-socket vectors (world) per change of the positions, closures kept; (3 contacts, nv).

    From the velocities that unit speeds give, so that no step width enters.
    """
    engine.select_pieces_after(engine.start)
    numbering = engine.model.numbering
    columns = []
    for k in range(numbering.nv):
        moved = y.copy()
        moved[numbering.nq : numbering.nq + numbering.nv] = 0.0
        moved[numbering.nq + k] = 1.0
        columns.append(_offset_rates(engine, project(engine, moved)))
    return np.array(columns).T


def _offset_rates(engine: Engine, y: np.ndarray) -> np.ndarray:
    engine.evaluate(y, engine.start)
    velocity = engine.table(m.SITE_FRAMES, engine.model.arrays.size(m.N_SITES))["velocity"]
    table = engine.model.arrays.table(m.CONTACTS)
    return np.concatenate([velocity[b] - velocity[a] for a, b in zip(table["outer"], table["inner"], strict=True)])


def perturbed(engine: Engine, y: np.ndarray, jacobian: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The start with the balls moved by `offsets` (3 per contact) as nearly as the joints allow."""
    engine.select_pieces_after(engine.start)
    numbering = engine.model.numbering
    speeds, *_ = np.linalg.lstsq(jacobian, offsets, rcond=1e-9)
    moving = y.copy()
    moving[numbering.nq : numbering.nq + numbering.nv] = speeds
    rates = engine.evaluate(project(engine, moving), engine.start)[: numbering.nq]
    moved = y.copy()
    moved[: numbering.nq] += rates  # rates per unit time, for one unit: a displacement of 1e-8 m is linear
    return project(engine, moved)
