"""Rotation vectors of bushings, continuous beyond half a turn; a full turn ends the run."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed, Series
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.numerics.rotations import matrix_to_quaternion
from flexclear.scene.loads import Bushing

#: rotation [rad] at which a bushing ends a run: at a full turn its rotation vector has no direction
LARGEST_ANGLE = 6.2


def rotations(model: Model, sites: np.ndarray, internal: np.ndarray) -> dict[int, np.ndarray]:
    """Return the rotation vector [rad] (3,) of every bushing that resists rotation, by its first internal state.

    sites: frames of all sites, rows of SITE_FRAMES with named fields.  internal: previous states, which they continue.
    """
    vectors = {}
    for row in model.rows_of(Bushing).values():
        first = int(row["internal0"])
        if first >= 0:
            R = sites[row["a"]]["axes"].T @ sites[row["b"]]["axes"]
            vectors[first] = nearest(R, internal[first : first + 3])
    return vectors


def nearest(R: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the rotation vector [rad] below a full turn of a matrix R which is closer to another one, shape (3,)."""
    q = matrix_to_quaternion(R)
    q, half = (q if q[0] >= 0.0 else -q), float(np.linalg.norm(q[1:]))
    shortest = q[1:] * (2.0 if half == 0.0 else 2.0 * np.arctan2(half, q[0]) / half)
    if half == 0.0:
        return np.asarray(shortest)
    other = shortest - 2.0 * np.pi * q[1:] / half
    return np.asarray(min((shortest, other), key=lambda v: float(np.sum((v - before) ** 2))))


def explanation(engine: Engine) -> str | None:
    """Return an explanation when a bushing is near a full turn in the engine's state, else None."""
    model, y = engine.model, engine.view(m.Y)
    first = model.ny - model.arrays.size(m.N_INTERNAL)
    for name, row in model.rows_of(Bushing).items():
        at = first + int(row["internal0"])
        angle = float(np.linalg.norm(y[at : at + 3])) if row["internal0"] >= 0 else 0.0
        if angle > 0.99 * LARGEST_ANGLE:
            return (
                f"bushing {name} has turned by {np.degrees(angle):.0f} deg: the rotation vector of an elastic mount "
                "has no direction at a full turn; use a joint for this rotation, with a joint-spring for its "
                "torque, or give the bushing neither stiffness nor damping against rotation"
            )
    return None


def bushing_series(model: Model, seen: Observed) -> Series:
    """Return displacement [m] and rotation vector [rad] of each second frame in the first one's axes; coordinates."""
    rows = model.rows_of(Bushing)
    displacement, rotation = (np.zeros((len(seen.state), len(rows), 3)) for _ in range(2))
    for k, row in enumerate(rows.values()):
        a, b = (seen.sites[:, row[end]] for end in ("a", "b"))
        to_first = np.swapaxes(a["axes"], 1, 2)
        displacement[:, k] = np.einsum("tij,tj->ti", to_first, b["origin"] - a["origin"])
        first = int(row["internal0"])
        at = model.ny - model.arrays.size(m.N_INTERNAL) + first
        # without resistance to rotation no state follows the rotation
        before = seen.state[:, at : at + 3] if first >= 0 else np.zeros((len(seen.state), 3))
        rotation[:, k] = [nearest(R, v) for R, v in zip(to_first @ b["axes"], before, strict=True)]
    dims = ("time", "bushing", "axis")
    return {"bushing_displacement": (dims, displacement), "bushing_rotation": (dims, rotation)}, {"bushing": list(rows)}
