"""Hinge about z of the first frame."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import ROTATION, angle_about_z, rates_are_speeds
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, about_z


@kernel
def motion(w, x, u, S):
    """Motion of frame G in frame F: x radians about z (see `spherical.motion`)."""
    for k in range(6):
        w[S + k] = 0.0
    w[S + 2] = 1.0
    return about_z(w[x]), ZERO, ZERO, ZERO


position_rate = rates_are_speeds(1)


class Revolute:
    """One rotation is free."""

    POSITIONS, SPEEDS = "r", "r"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
    ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
    COORDINATES = (ROTATION,)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Angle about z [rad] in (-pi, pi], shape (1,)."""
        return np.array([angle_about_z(R)])
