"""Ball joint: rotation by a quaternion, angular velocity in the axes of the first frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.joints.relative import Relative, from_quaternion, quaternion_rate
from flexclear.dynamics.vectors import AXES, ZERO, Twist
from flexclear.numerics.rotations import matrix_to_quaternion


def motion(x: Any, u: Any) -> Relative:
    """Return the motion by a quaternion."""
    return Relative(from_quaternion(x), ZERO, [Twist(axis, ZERO) for axis in AXES])


position_rate = quaternion_rate

POSITIONS, SPEEDS = "rrrr", "rrr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ()
COORDINATES: tuple[Coordinate, ...] = ()


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the quaternion of R_FG, shape (4,); closure constraints treat the offset p."""
    return matrix_to_quaternion(R)
