"""Sliding in the plane of x and y of the first frame, and turning about z."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import ROTATION, Coordinate, angle_about_z
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import about_z, put9


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: x metres along x and y of F, radians about z (see `spherical.motion`)."""
    for k in range(m.JOINT.columns + 18):
        w[joint + k] = 0.0
    put9(w, joint + m.JOINT.rotation, about_z(w[x + 2]))
    for k in range(2):
        w[joint + m.JOINT.position + k] = w[x + k]
        w[joint + m.JOINT.velocity + k] = w[u + k]
        w[joint + m.JOINT.acceleration + k] = w[du + k]
        w[joint + m.JOINT.columns + 7 * k + 3] = 1.0
        w[rate + k] = w[u + k]
    w[joint + m.JOINT.omega + 2] = w[rate + 2] = w[u + 2]
    w[joint + m.JOINT.alpha + 2] = w[du + 2]
    w[joint + m.JOINT.columns + 12 + 2] = 1.0


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
