"""Sliding joint along z of the first frame."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import TRANSLATION
from pipeline.dynamics.kernels import kernel


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: x metres along z (see `spherical.motion`)."""
    for k in range(m.JOINT.columns + 6):
        w[joint + k] = 0.0
    w[joint] = w[joint + 4] = w[joint + 8] = 1.0
    w[joint + m.JOINT.position + 2] = w[x]
    w[joint + m.JOINT.velocity + 2] = w[u]
    w[joint + m.JOINT.acceleration + 2] = w[du]
    w[joint + m.JOINT.columns + 5] = 1.0
    w[rate] = w[u]


class Prismatic:
    """One displacement is free."""

    POSITIONS, SPEEDS = "t", "t"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1)
    ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 0))
    COORDINATES = (TRANSLATION,)
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Displacement along z [m], shape (1,)."""
        return np.array([p[2]])
