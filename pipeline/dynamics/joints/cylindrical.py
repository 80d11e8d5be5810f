"""Turning about and sliding along z of the first frame."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import ROTATION, TRANSLATION, angle_about_z, rates_are_speeds
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, about_z


@kernel
def motion(w, x, u, S):
    """Motion of frame G in frame F: x radians about z, then metres along z (see `spherical.motion`)."""
    for k in range(12):
        w[S + k] = 0.0
    w[S + 2] = w[S + 6 + 5] = 1.0
    return about_z(w[x]), (0.0, 0.0, w[x + 1]), ZERO, ZERO


position_rate = rates_are_speeds(2)


class Cylindrical:
    """One rotation and the displacement along its axis are free."""

    POSITIONS, SPEEDS = "rt", "rt"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1)
    ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
    COORDINATES = (ROTATION, TRANSLATION)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Angle about z [rad] in (-pi, pi], displacement along z [m], shape (2,)."""
        return np.array([angle_about_z(R), p[2]])
