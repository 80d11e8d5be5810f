"""Static compliance at the frames of the full model, and the fraction of it that a basis has."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.artifacts.compliance import DIRECTIONS, fractions, reduced
from flexclear.pipeline.structure.fe.model import Interface
from flexclear.pipeline.structure.modes.condition import in_own_axes
from flexclear.pipeline.structure.modes.statics import Flexibility


def frames(flexibility: Flexibility, interfaces: tuple[Interface, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Motion of p frames in their own axes: functionals, (6 p, ndof), and under the six rigid motions, (p, 6, 6)."""
    motion = np.vstack([in_own_axes(frame).toarray() for frame in interfaces])
    return motion, (motion @ flexibility.model.rigid).reshape(-1, 6, 6)


def full(flexibility: Flexibility, interfaces: tuple[Interface, ...]) -> np.ndarray:
    """Compliance [m/N, rad/(N m)] of each frame with each held (or, with itself, nothing), shape (p, p, 6)."""
    (motion, rigid), p = frames(flexibility, interfaces), len(interfaces)
    loads = np.hstack([motion.T, flexibility.momentum])
    gram = loads.T @ flexibility.response(loads)
    result = np.empty((p, p, 6))
    for i in range(p):
        for j in range(p):
            # the load on i and its reaction: at j, or the inertia of the whole body
            balance = np.zeros((6 * p + 6, 6))
            balance[6 * i : 6 * i + 6] = np.eye(6)
            if i == j:
                balance[6 * p :] = -np.linalg.solve(flexibility.inertia, rigid[i].T)
            else:
                balance[6 * j : 6 * j + 6] = -np.linalg.solve(rigid[j].T, rigid[i].T)
            result[i, j] = np.einsum("ad,ab,bd->d", balance, gram, balance)
    return result


def of_basis(flexibility: Flexibility, interfaces: tuple[Interface, ...], vectors: np.ndarray) -> np.ndarray:
    """Compliance that shapes of (ndof, n) can show, likewise; any combination and scale of them."""
    functionals, rigid = frames(flexibility, interfaces)
    K = vectors.T @ (flexibility.model.stiffness @ vectors)
    relief = np.linalg.solve(flexibility.inertia, flexibility.momentum.T @ vectors)
    scale = 1.0 / np.sqrt(np.diag(K))
    inner = scale[:, None] * (0.5 * (K + K.T)) * scale
    motion = (functionals @ (vectors * scale)).reshape(len(interfaces), 6, -1)
    return reduced(motion, rigid, relief * scale, inner)


def least(flexibility: Flexibility, interfaces: tuple[Interface, ...], vectors: np.ndarray) -> tuple[float, str]:
    """Smallest fraction of the compliance between the interfaces (of a single one: of the free body), and where."""
    whole = full(flexibility, interfaces)
    each = fractions(of_basis(flexibility, interfaces, vectors), whole)
    if len(interfaces) > 1:
        each[np.arange(len(each)), np.arange(len(each))] = 1.0
    i, j, d = np.unravel_index(int(np.argmin(each)), each.shape)
    held = "with nothing held" if i == j else f"with '{interfaces[j].name}' held"
    return float(each[i, j, d]), f"{DIRECTIONS[d]} of '{interfaces[i].name}' {held}"
