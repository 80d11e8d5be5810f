"""How far bushings give, for the run dataset."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.algebra import matrix_to_quaternion
from flexclear.pipeline.core.scene.loads import Bushing
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.model import Model


def give(model: Model, seen: Observed) -> tuple[dict[str, tuple[tuple[str, ...], np.ndarray]], dict[str, object]]:
    """Displacement [m] and rotation vector [rad] of each second frame in the first one's axes, and their coordinate."""
    names = [name for name, load in model.scene.forces().items() if isinstance(load, Bushing)]
    wiring, places = model.arrays.table(m.LOADS), {name: k for k, (name, _) in enumerate(model.loads)}
    displacement, rotation = (np.zeros((len(seen.state), len(names), 3)) for _ in range(2))
    for k, name in enumerate(names):
        a, b = (seen.sites[:, wiring[places[name]][end]] for end in ("a", "b"))
        to_first = np.swapaxes(a["axes"], 1, 2)
        displacement[:, k] = np.einsum("tij,tj->ti", to_first, b["origin"] - a["origin"])
        rotation[:, k] = [_vector(R) for R in to_first @ b["axes"]]
    dims = ("time", "bushing", "axis")
    return {"bushing_displacement": (dims, displacement), "bushing_rotation": (dims, rotation)}, {"bushing": names}


def _vector(R: np.ndarray) -> np.ndarray:
    """The shortest rotation vector of a rotation matrix, shape (3,)."""
    q = matrix_to_quaternion(R)
    q, half = (q if q[0] >= 0.0 else -q), np.linalg.norm(q[1:])
    return np.asarray(q[1:] * (2.0 if half == 0.0 else 2.0 * np.arctan2(half, q[0]) / half))
