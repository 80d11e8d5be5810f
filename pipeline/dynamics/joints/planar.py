"""Sliding in the plane of x and y of the first frame, and turning about z."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.joints.coordinate import ROTATION, Coordinate, angle_about_z
from pipeline.dynamics.tables import (
    J_ACCELERATION,
    J_ALPHA,
    J_COLUMNS,
    J_OMEGA,
    J_POSITION,
    J_ROTATION,
    J_VELOCITY,
)
from pipeline.dynamics.vectors import about_z, kernel, put9


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: x metres along x and y of F, radians about z (see `spherical.motion`)."""
    for k in range(J_COLUMNS + 18):
        w[joint + k] = 0.0
    put9(w, joint + J_ROTATION, about_z(w[x + 2]))
    for k in range(2):
        w[joint + J_POSITION + k] = w[x + k]
        w[joint + J_VELOCITY + k] = w[u + k]
        w[joint + J_ACCELERATION + k] = w[du + k]
        w[joint + J_COLUMNS + 7 * k + 3] = 1.0
        w[rate + k] = w[u + k]
    w[joint + J_OMEGA + 2] = w[rate + 2] = w[u + 2]
    w[joint + J_ALPHA + 2] = w[du + 2]
    w[joint + J_COLUMNS + 12 + 2] = 1.0


class Planar:
    """Two displacements and the rotation about their normal are free."""

    POSITIONS, SPEEDS = "ttr", "ttr"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (2,)
    ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
    COORDINATES = (Coordinate("x", False, axis=0), Coordinate("y", False, axis=1), ROTATION)
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Displacements along x and y [m], angle about z [rad] in (-pi, pi], shape (3,)."""
        return np.array([p[0], p[1], angle_about_z(R)])
