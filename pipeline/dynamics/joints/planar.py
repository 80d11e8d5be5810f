"""Sliding in the plane of x and y of the first frame, and turning about z."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import ROTATION, Coordinate, angle_about_z, rates_are_speeds
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, about_z


@kernel
def motion(w, x, u, S):
    """Motion of frame G in frame F: x metres along x and y of F, radians about z (see `spherical.motion`)."""
    for k in range(18):
        w[S + k] = 0.0
    w[S + 3] = w[S + 6 + 4] = w[S + 12 + 2] = 1.0
    return about_z(w[x + 2]), (w[x], w[x + 1], 0.0), ZERO, ZERO


position_rate = rates_are_speeds(3)


class Planar:
    """Two displacements and the rotation about their normal are free."""

    POSITIONS, SPEEDS = "ttr", "ttr"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (2,)
    ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
    COORDINATES = (Coordinate("x", False, axis=0), Coordinate("y", False, axis=1), ROTATION)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Displacements along x and y [m], angle about z [rad] in (-pi, pi], shape (3,)."""
        return np.array([p[0], p[1], angle_about_z(R)])
