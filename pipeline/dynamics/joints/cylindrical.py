"""Turning about and sliding along z of the first frame."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import ROTATION, TRANSLATION, angle_about_z
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import about_z, put9


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: x radians about z, then metres along z (see `spherical.motion`)."""
    for k in range(m.JOINT.columns + 12):
        w[joint + k] = 0.0
    put9(w, joint + m.JOINT.rotation, about_z(w[x]))
    w[joint + m.JOINT.position + 2] = w[x + 1]
    w[joint + m.JOINT.omega + 2], w[joint + m.JOINT.velocity + 2] = w[u], w[u + 1]
    w[joint + m.JOINT.alpha + 2], w[joint + m.JOINT.acceleration + 2] = w[du], w[du + 1]
    w[joint + m.JOINT.columns + 2] = w[joint + m.JOINT.columns + 6 + 5] = 1.0
    w[rate], w[rate + 1] = w[u], w[u + 1]


class Cylindrical:
    """One rotation and the displacement along its axis are free."""

    POSITIONS, SPEEDS = "rt", "rt"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1)
    ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
    COORDINATES = (ROTATION, TRANSLATION)
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Angle about z [rad] in (-pi, pi], displacement along z [m], shape (2,)."""
        return np.array([angle_about_z(R), p[2]])
