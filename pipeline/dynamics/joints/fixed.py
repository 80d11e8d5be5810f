"""Rigid connection; met in the tree only where one of the two bodies is flexible."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.kernels import kernel


@kernel
def motion(w, x, u, du, joint, rate):
    """The two frames coincide (see `spherical.motion`)."""
    for k in range(m.JOINT.columns):
        w[joint + k] = 0.0
    w[joint] = w[joint + 4] = w[joint + 8] = 1.0


class Fixed:
    """Nothing is free."""

    POSITIONS, SPEEDS = "", ""  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
    ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 0))
    COORDINATES: tuple[Coordinate, ...] = ()
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """No coordinates, shape (0,)."""
        return np.zeros(0)
