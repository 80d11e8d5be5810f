"""Rotation vectors of bushings, continuous beyond half a turn."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.model.model import Model
from flexclear.numerics.rotations import matrix_to_quaternion
from flexclear.scene.loads import Bushing


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
