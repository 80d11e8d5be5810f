"""Ball joint: rotation by a quaternion, angular velocity in the axes of the first frame."""

from __future__ import annotations

import numpy as np

from pipeline.core.algebra import matrix_to_quaternion
from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import from_quaternion, put9, quaternion_rate


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F, components in F; all arguments after w are places in it.

    x: quaternion of R_FG (4); u: angular velocity [rad/s] (3); du: known part of its rate (3).
    Fills `joint` (layout: tables.J_*) and the position rates `rate` (4).
    """
    R = from_quaternion(w[x], w[x + 1], w[x + 2], w[x + 3])
    put9(w, joint + m.JOINT.rotation, R)
    for k in range(9, m.JOINT.columns + 18):
        w[joint + k] = 0.0
    for k in range(3):
        w[joint + m.JOINT.omega + k] = w[u + k]
        w[joint + m.JOINT.alpha + k] = w[du + k]
        w[joint + m.JOINT.columns + 7 * k] = 1.0
    quaternion_rate(w, x, u, rate)


class Spherical:
    """Three rotations are free; a closure keeps the two origins together."""

    POSITIONS, SPEEDS = "rrrr", "rrr"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
    ROTATIONS: tuple[tuple[int, int], ...] = ()
    COORDINATES: tuple[Coordinate, ...] = ()
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Quaternion of R_FG, shape (4,); the offset p is the closure's business."""
        return matrix_to_quaternion(R)
