"""Free joint: six free motions of a body that no joint connects to the ground."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, at, from_quaternion, put, quaternion_rate
from flexclear.numerics.rotations import matrix_to_quaternion


@kernel
def motion(w, x, u, S):
    """Compute the motion of frame G in frame F: quaternion and position from x, 7 numbers (see `spherical.motion`).

    u: angular velocity, then velocity of G's origin, components in F, 6 numbers.
    """
    for k in range(36):
        w[S + k] = 0.0
    for k in range(6):
        w[S + 7 * k] = 1.0
    return from_quaternion(w[x], w[x + 1], w[x + 2], w[x + 3]), at(w, x + 4), ZERO, ZERO


@kernel
def position_rate(w, x, u, rate):
    """Store the rates of quaternion and position."""
    quaternion_rate(w, x, u, rate)
    put(w, rate + 4, at(w, u + 3))


POSITIONS, SPEEDS = "rrrrttt", "rrrttt"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = ()
ROTATIONS: tuple[tuple[int, int], ...] = ()
COORDINATES: tuple[Coordinate, ...] = ()


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return quaternion and position, shape (7,)."""
    return np.concatenate([matrix_to_quaternion(R), p])
