"""Ball joint: rotation by a quaternion, angular velocity in the axes of the first frame."""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, from_quaternion, quaternion_rate
from flexclear.numerics.rotations import matrix_to_quaternion


@kernel
def motion(w, x, u, S):
    """Compute pose and motion subspace of frame G in frame F; return R_FG, p_FG and the bias S' u, all in axes of F.

    All arguments after w are indices in w.  x: quaternion of R_FG (4).  u: angular velocity [rad/s] (3). S: receives a
    twist (angular velocity; velocity of G's origin) per unit speed, so that the relative twist is S u and its rate S u'
    + bias; the bias has an angular and a linear part.
    """
    for k in range(18):
        w[S + k] = 0.0
    for k in range(3):
        w[S + 7 * k] = 1.0
    return from_quaternion(w[x], w[x + 1], w[x + 2], w[x + 3]), ZERO, ZERO, ZERO


@kernel
def position_rate(w, x, u, rate):
    """Store the rates of the positions x at the speeds u; all arguments are indices in w."""
    quaternion_rate(w, x, u, rate)


POSITIONS, SPEEDS = "rrrr", "rrr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ()
COORDINATES: tuple[Coordinate, ...] = ()


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the quaternion of R_FG, shape (4,); closure constraints treat the offset p."""
    return matrix_to_quaternion(R)
