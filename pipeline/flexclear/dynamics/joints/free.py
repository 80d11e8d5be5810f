"""Free joint: six free motions of a body that no joint connects to the ground."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.joints.relative import Relative, from_quaternion, quaternion_rate
from flexclear.dynamics.vectors import AXES, ZERO, Twist, Vector
from flexclear.numerics.rotations import matrix_to_quaternion


def motion(x: Any, u: Any) -> Relative:
    """Return the motion by quaternion and position; speeds: angular velocity, then velocity of G's origin."""
    S = [*(Twist(axis, ZERO) for axis in AXES), *(Twist(ZERO, axis) for axis in AXES)]
    return Relative(from_quaternion(x[:4]), Vector(x[4:]), S)


def position_rate(x: Any, u: Any) -> list[Any]:
    """Return the rates of quaternion and position."""
    return [*quaternion_rate(x[:4], u[:3]), *u[3:]]


POSITIONS, SPEEDS = "rrrrttt", "rrrttt"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = ()
ROTATIONS: tuple[tuple[int, int], ...] = ()
COORDINATES: tuple[Coordinate, ...] = ()


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return quaternion and position, shape (7,)."""
    return np.concatenate([matrix_to_quaternion(R), p])
