"""An Oldham coupling: the second frame slides along x and y of the first and does not turn in it."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate, rates_are_speeds
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import IDENTITY, ZERO


@kernel
def motion(w, x, u, S):
    """Motion of frame G in frame F: metres along x, then along y (see `spherical.motion`)."""
    for k in range(12):
        w[S + k] = 0.0
    w[S + 3] = w[S + 6 + 4] = 1.0
    return IDENTITY, (w[x], w[x + 1], 0.0), ZERO, ZERO


position_rate = rates_are_speeds(2)

POSITIONS, SPEEDS = "tt", "tt"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (2,)
ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 0))
COORDINATES = (Coordinate("x", False, axis=0), Coordinate("y", False, axis=1))


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Displacements along x and y [m], shape (2,)."""
    return p[:2]
