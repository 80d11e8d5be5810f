"""Hinge about z of the first frame."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import ROTATION, angle_about_z
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import about_z, put9


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: x radians about z (see `spherical.motion`)."""
    for k in range(m.JOINT.columns + 6):
        w[joint + k] = 0.0
    put9(w, joint + m.JOINT.rotation, about_z(w[x]))
    w[joint + m.JOINT.omega + 2] = w[u]
    w[joint + m.JOINT.alpha + 2] = w[du]
    w[joint + m.JOINT.columns + 2] = 1.0
    w[rate] = w[u]


class Revolute:
    """One rotation is free."""

    POSITIONS, SPEEDS = "r", "r"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
    ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
    COORDINATES = (ROTATION,)
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Angle about z [rad] in (-pi, pi], shape (1,)."""
        return np.array([angle_about_z(R)])
