"""Factor of the mass matrix and bias forces, in full, from what an evaluation left in the work space."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.model.model import Model
    from flexclear.pipeline.dynamics.run.engine import Engine

#: tables that hold what acts on links
WRENCHES = (m.WRENCH, m.ARTICULATED, m.LINK_FRAMES)


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
    moments, forces = _beyond(model, *_wrenches(*map(engine.table, WRENCHES)))
    columns = engine.table(m.COLUMNS)
    return _along(model, columns["angular"], moments) + _along(model, columns["linear"], forces)


def bias_changes(engine: Engine, change: Callable[[int], np.ndarray]) -> np.ndarray:
    """Return the changes of `bias` along directions, shape (directions, nv).

    change(stretch): those of a stretch of the work space, (directions, length).
    """
    model = engine.model
    if not model.parts.articulated:
        return change(m.BIAS)[:, : model.nv]

    def changed(table: Any) -> np.ndarray:
        return m.named(table, change(table.place))

    loads, bodies, frames = map(engine.table, WRENCHES)
    moments, forces = _wrenches(changed(m.WRENCH), changed(m.ARTICULATED), frames)
    moments = moments + np.cross(changed(m.LINK_FRAMES)["origin"], bodies["own_force"])
    at, on = _beyond(model, *_wrenches(loads, bodies, frames)), _beyond(model, moments, forces)
    columns, turned = engine.table(m.COLUMNS), changed(m.COLUMNS)
    kept = _along(model, columns["angular"], on[0]) + _along(model, columns["linear"], on[1])
    return kept + _along(model, turned["angular"], at[0]) + _along(model, turned["linear"], at[1])


def _wrenches(loads: np.ndarray, bodies: np.ndarray, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return moments and forces on the links and what they carry, shape (..., links, 3)."""
    moments = loads["moment"] + bodies["own_moment"] + np.cross(frames["origin"], bodies["own_force"])
    return moments, loads["force"] + bodies["own_force"]


def _beyond(model: Model, *wrenches: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return those of each link with all links beyond it."""
    for total in wrenches:
        for i in range(len(model.links) - 1, 0, -1):
            total[..., model.links[i].branch.parent, :] += total[..., i, :]
    return wrenches


def _along(model: Model, columns: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return the products of the columns of coordinates with what acts on their links, shape (..., nv)."""
    pairs = [(k, i) for i, mine in enumerate(model.numbering.coordinates) if i for k in mine if k < model.nv]
    coordinates, links = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    made = np.zeros((*np.broadcast_shapes(columns.shape[:-2], total.shape[:-2]), model.nv))
    made[..., coordinates] = np.sum(columns[..., coordinates, :] * total[..., links, :], axis=-1)
    return made
