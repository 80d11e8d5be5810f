"""Rotation vectors of bushings, followed continuously beyond half a turn."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.numerics.rotations import matrix_to_quaternion
from flexclear.pipeline.core.scene.loads import Bushing
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.model.model import Model


def rotations(model: Model, sites: np.ndarray, internal: np.ndarray) -> dict[int, np.ndarray]:
    """Rotation vector [rad], shape (3,), of every bushing that resists rotation, by its first internal state.

    sites: frames of all sites, rows of SITE_FRAMES with named fields.  internal: states that the vectors continue.
    """
    vectors = {}
    for (name, _), row in zip(model.loads, model.arrays.table(m.LOADS), strict=True):
        first = int(row["internal0"])
        if first >= 0 and isinstance(model.scene.load[name], Bushing):
            R = sites[row["a"]]["axes"].T @ sites[row["b"]]["axes"]
            vectors[first] = nearest(R, internal[first : first + 3])
    return vectors


def nearest(R: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Of the two rotation vectors [rad] below a full turn of a matrix R the one closer to another, shape (3,)."""
    q = matrix_to_quaternion(R)
    q, half = (q if q[0] >= 0.0 else -q), float(np.linalg.norm(q[1:]))
    shortest = q[1:] * (2.0 if half == 0.0 else 2.0 * np.arctan2(half, q[0]) / half)
    if half == 0.0:
        return np.asarray(shortest)
    other = shortest - 2.0 * np.pi * q[1:] / half
    return np.asarray(min((shortest, other), key=lambda v: float(np.sum((v - before) ** 2))))
