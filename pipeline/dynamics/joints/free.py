"""Six free motions: how a body that no joint holds moves against the ground."""

from __future__ import annotations

import numpy as np

from pipeline.core.algebra import matrix_to_quaternion
from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import from_quaternion, put9, quaternion_rate


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: quaternion and position from x, 7 numbers (see `spherical.motion`).

    u: angular velocity, then velocity of G's origin, components in F, 6 numbers.
    """
    put9(w, joint + m.JOINT.rotation, from_quaternion(w[x], w[x + 1], w[x + 2], w[x + 3]))
    for k in range(36):
        w[joint + m.JOINT.columns + k] = 0.0
    for k in range(3):
        w[joint + m.JOINT.position + k] = w[x + 4 + k]
        w[joint + m.JOINT.omega + k] = w[u + k]
        w[joint + m.JOINT.velocity + k] = w[u + 3 + k]
        w[joint + m.JOINT.alpha + k] = w[du + k]
        w[joint + m.JOINT.acceleration + k] = w[du + 3 + k]
        w[joint + m.JOINT.columns + 7 * k] = 1.0
        w[joint + m.JOINT.columns + 18 + 7 * k + 3] = 1.0
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
