"""A pin in a straight slot: sliding along x of the first frame and turning about z."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import ROTATION, Coordinate, angle_about_z, rates_are_speeds
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, about_z


@kernel
def motion(w, x, u, S):
    """Motion of frame G in frame F: metres along x, then radians about z (see `spherical.motion`)."""
    for k in range(12):
        w[S + k] = 0.0
    w[S + 3] = w[S + 6 + 2] = 1.0
    return about_z(w[x + 1]), (w[x], 0.0, 0.0), ZERO, ZERO


position_rate = rates_are_speeds(2)

POSITIONS, SPEEDS = "tr", "tr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ((2, 0), (2, 1))
COORDINATES = (Coordinate("translation", False, axis=0), ROTATION)


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Displacement along x [m], angle about z [rad] in (-pi, pi], shape (2,)."""
    return np.array([p[0], angle_about_z(R)])
