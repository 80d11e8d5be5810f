"""Factor of the mass matrix and bias forces as full arrays, from the results of an evaluation in the work array."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation.engine import Engine


def mass_factor(engine: Engine) -> np.ndarray:
    """Return L of the mass matrix M = L L^T of the last evaluation, shape (nv, nv)."""
    return _from_envelope(engine) + _from_gains(engine)


def _from_envelope(engine: Engine) -> np.ndarray:
    """Return the blocks of modes and coordinates of the factor."""
    L, entries = np.zeros((engine.model.nv,) * 2), engine.view(m.MASS)
    for i, (first, origin) in enumerate(engine.model.arrays.table(m.ENVELOPE)):
        L[i, first : i + 1] = entries[origin + first : origin + i + 1]
        L[i, i] = 1.0 / L[i, i]
    return L


def _from_gains(engine: Engine) -> np.ndarray:
    """Return the products of columns with the gains of the coordinates beyond them."""
    numbering, columns, gains = engine.model.numbering, engine.table(m.COLUMNS), engine.table(m.GAIN)
    L, origins = np.zeros((engine.model.nv,) * 2), engine.table(m.LINK_FRAMES)["origin"]
    for i in range(1, len(numbering.coordinates)):
        pairs = [pair for pair in numbering.joint_route(i) if pair[0] < numbering.nv]
        route, modal = np.array(pairs, dtype=np.int64).reshape(-1, 2), numbering.modal_coordinates.get(i, ())
        for k in (c for c in (*modal, *numbering.coordinates[i]) if c < numbering.nv):
            force = gains["force"][k]
            moment = gains["moment"][k] + np.cross(origins[i], force)
            nearer, their = route[route[:, 0] > k].T
            L[nearer, k] = columns["angular"][their] @ moment + columns["linear"][their] @ force
    return L


def carried_wrenches(engine: Engine) -> tuple[np.ndarray, np.ndarray]:
    """Return the wrench that each link and its subtree need for the motion without free accelerations.

    Moments about the kernels' origin and forces, shapes (links, 3).
    """
    needed, own = engine.table(m.WRENCH), engine.table(m.ARTICULATED)
    origins = engine.table(m.LINK_FRAMES)["origin"]
    moments = needed["moment"] + own["own_moment"] + np.cross(origins, own["own_force"])
    pushes = needed["force"] + own["own_force"]
    for i in range(len(moments) - 1, 0, -1):
        above = engine.model.links[i].branch.parent
        moments[above] += moments[i]
        pushes[above] += pushes[i]
    return moments, pushes


def bias(engine: Engine) -> np.ndarray:
    """Return the generalised forces that the motion needs without free accelerations, shape (nv,)."""
    model, columns, (moments, pushes) = engine.model, engine.table(m.COLUMNS), carried_wrenches(engine)
    numbering, forces = model.numbering, engine.view(m.MODAL_BIAS)[: model.nv].copy()
    modal = [k for modes in numbering.modal_coordinates.values() for k in modes]
    forces[np.setdiff1d(np.arange(model.nv), modal)] = 0.0
    for i in range(len(moments) - 1, 0, -1):
        above = model.links[i].branch.parent
        shapes = numbering.moving(above) if model.links[above].flexible else ()
        mine = {*shapes, *(c for c in numbering.coordinates[i] if c < model.nv)}
        for k, column in (pair for pair in numbering.joint_route(i) if pair[0] in mine):
            forces[k] += columns["angular"][column] @ moments[i] + columns["linear"][column] @ pushes[i]
    return forces
