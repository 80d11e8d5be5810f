"""Six free motions: how a body that no joint holds moves against the ground."""

from __future__ import annotations

import numpy as np

from pipeline.core.algebra import matrix_to_quaternion
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.tables import J_ACCELERATION, J_ALPHA, J_COLUMNS, J_OMEGA, J_POSITION, J_ROTATION, J_VELOCITY
from pipeline.dynamics.vectors import from_quaternion, kernel, put9, quaternion_rate


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: quaternion and position from x, 7 numbers (see `spherical.motion`).

    u: angular velocity, then velocity of G's origin, components in F, 6 numbers.
    """
    put9(w, joint + J_ROTATION, from_quaternion(w[x], w[x + 1], w[x + 2], w[x + 3]))
    for k in range(36):
        w[joint + J_COLUMNS + k] = 0.0
    for k in range(3):
        w[joint + J_POSITION + k] = w[x + 4 + k]
        w[joint + J_OMEGA + k] = w[u + k]
        w[joint + J_VELOCITY + k] = w[u + 3 + k]
        w[joint + J_ALPHA + k] = w[du + k]
        w[joint + J_ACCELERATION + k] = w[du + 3 + k]
        w[joint + J_COLUMNS + 7 * k] = 1.0
        w[joint + J_COLUMNS + 18 + 7 * k + 3] = 1.0
        w[rate + 4 + k] = w[u + 3 + k]
    quaternion_rate(w, x, u, rate)


class Free:
    """Everything is free; as a closure it would demand nothing."""

    POSITIONS, SPEEDS = "rrrrttt", "rrrttt"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = ()
    ROTATIONS: tuple[tuple[int, int], ...] = ()
    COORDINATES: tuple[Coordinate, ...] = ()
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Quaternion and position, shape (7,)."""
        return np.concatenate([matrix_to_quaternion(R), p])
