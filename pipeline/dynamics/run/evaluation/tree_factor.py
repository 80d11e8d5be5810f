"""Factor of the mass matrix and bias forces, in full, from what an evaluation left in the work space."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine


def mass_factor(engine: Engine) -> np.ndarray:
    """Return L of the mass matrix M = L L^T of the last evaluation, shape (nv, nv)."""
    return _from_gains(engine) if engine.model.parts.articulated else _from_envelope(engine)


def _from_envelope(engine: Engine) -> np.ndarray:
    L, entries = np.zeros((engine.model.nv,) * 2), engine.view(m.MASS)
    for i, (first, origin) in enumerate(engine.model.arrays.table(m.ENVELOPE)):
        L[i, first : i + 1] = entries[origin + first : origin + i + 1]
        L[i, i] = 1.0 / L[i, i]
    return L


def _from_gains(engine: Engine) -> np.ndarray:
    """Columns of coordinates times the gains of those beyond them."""
    numbering, columns, gains = engine.model.numbering, engine.table(m.COLUMNS), engine.table(m.GAIN)
    L, origins = np.diag(1.0 / engine.view(m.MASS)), engine.table(m.LINK_FRAMES)["origin"]
    for i in range(1, len(numbering.coordinates)):
        route = np.array([pair for pair in numbering.joint_route(i) if pair[0] < numbering.nv], dtype=np.int64)
        for k in (c for c in numbering.coordinates[i] if c < numbering.nv):
            force = gains["force"][k]
            moment = gains["moment"][k] + np.cross(origins[i], force)
            nearer, their = route[route[:, 0] > k].T
            L[nearer, k] = columns["angular"][their] @ moment + columns["linear"][their] @ force
    return L


def bias(engine: Engine, w: np.ndarray | None = None) -> np.ndarray:
    """Return the generalised forces that the motion needs without free accelerations, shape (nv,).

    w: the work space; that of the last evaluation, or one of numbers with changes (`specialise.dual`).
    """
    model, w = engine.model, engine.w if w is None else w

    def stretch(index: int) -> np.ndarray:
        return w[engine.h[index] : engine.h[index] + engine.lengths[index]]

    def vectors(table: Any, field: int) -> np.ndarray:
        return stretch(table.place).reshape(-1, table.size)[:, field : field + 3]

    if not model.parts.articulated:
        return stretch(m.BIAS)[: model.nv].copy()
    carried, origins = vectors(m.ARTICULATED, m.ARTICULATED.own_force), vectors(m.LINK_FRAMES, m.LINK_FRAMES.origin)
    moments = vectors(m.WRENCH, m.WRENCH.moment) + vectors(m.ARTICULATED, m.ARTICULATED.own_moment)
    moments, pushes = moments + np.cross(origins, carried), vectors(m.WRENCH, m.WRENCH.force) + carried
    turns, shifts = vectors(m.COLUMNS, m.COLUMNS.angular), vectors(m.COLUMNS, m.COLUMNS.linear)
    forces = np.zeros(model.nv, dtype=w.dtype)
    for i in range(len(moments) - 1, 0, -1):
        for k in (c for c in model.numbering.coordinates[i] if c < model.nv):
            forces[k] = np.sum(turns[k] * moments[i] + shifts[k] * pushes[i])
        above = model.links[i].branch.parent
        moments[above] += moments[i]
        pushes[above] += pushes[i]
    return forces
