"""Cardan joint: rotation about x of the first frame, then about y of the rotated frame."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate, rates_are_speeds
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, cross, put, scale


@kernel
def motion(w, x, u, S):
    """Compute the motion of frame G in frame F: R_FG = R_x(x0) R_y(x1) (see `spherical.motion`)."""
    ca, sa, cb, sb = np.cos(w[x]), np.sin(w[x]), np.cos(w[x + 1]), np.sin(w[x + 1])
    first, second = (1.0, 0.0, 0.0), (0.0, ca, sa)
    put(w, S, first)
    put(w, S + 3, ZERO)
    put(w, S + 6, second)
    put(w, S + 9, ZERO)
    R = (cb, 0.0, sb, sa * sb, ca, -sa * cb, -ca * sb, sa, ca * cb)
    return R, ZERO, scale(w[u] * w[u + 1], cross(first, second)), ZERO


position_rate = rates_are_speeds(2)

POSITIONS, SPEEDS = "rr", "rr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1),)
COORDINATES = (
    Coordinate("first", True, axis=0, sine=(2, 1), cosine=(1, 1)),
    Coordinate("second", True, axis=1, side=1, sine=(0, 2), cosine=(0, 0)),
)


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the angles about x of the first and y of the second frame [rad] in (-pi, pi], shape (2,)."""
    return np.array([np.arctan2(R[2, 1], R[1, 1]), np.arctan2(R[0, 2], R[0, 0])])
