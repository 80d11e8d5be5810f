"""Factor of the mass matrix and bias forces, in full, from what an evaluation left in the work space."""

from __future__ import annotations

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


def bias(engine: Engine) -> np.ndarray:
    """Return the generalised forces that the motion needs without free accelerations, shape (nv,)."""
    model = engine.model
    if not model.parts.articulated:
        return engine.view(m.BIAS)[: model.nv].copy()
    wrenches, columns = engine.table(m.WRENCH).copy(), engine.table(m.COLUMNS)
    bodies, origins, forces = engine.table(m.ARTICULATED), engine.table(m.LINK_FRAMES)["origin"], np.zeros(model.nv)
    wrenches["moment"] += bodies["own_moment"] + np.cross(origins, bodies["own_force"])
    wrenches["force"] += bodies["own_force"]
    for i in range(len(wrenches) - 1, 0, -1):
        for k in (c for c in model.numbering.coordinates[i] if c < model.nv):
            forces[k] = columns["angular"][k] @ wrenches["moment"][i] + columns["linear"][k] @ wrenches["force"][i]
        above = model.links[i].branch.parent
        wrenches["moment"][above] += wrenches["moment"][i]
        wrenches["force"][above] += wrenches["force"][i]
    return forces
