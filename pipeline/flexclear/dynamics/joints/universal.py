"""Cardan joint: rotation about x of the first frame, then about y of the rotated frame."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.joints.relative import Relative, rates_are_speeds
from flexclear.dynamics.specialise.symbols import cos, sin
from flexclear.dynamics.vectors import AXES, ZERO, Matrix, Twist, Vector, cross


def motion(x: Any, u: Any) -> Relative:
    """Return the motion by R_FG = R_x(x0) R_y(x1)."""
    (ca, sa), (cb, sb) = ((cos(angle), sin(angle)) for angle in x)
    first, second = AXES[0], Vector([0.0, ca, sa])
    R_FG = Matrix([cb, 0.0, sb, sa * sb, ca, -sa * cb, -ca * sb, sa, ca * cb])
    bias = Twist(u[0] * u[1] * cross(first, second), ZERO)
    return Relative(R_FG, ZERO, [Twist(first, ZERO), Twist(second, ZERO)], bias)


position_rate = rates_are_speeds

POSITIONS, SPEEDS = "rr", "rr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1),)
COORDINATES = (
    Coordinate("first", True, axis=0, sine=(2, 1), cosine=(1, 1)),
    Coordinate("second", True, axis=1, side=1, sine=(0, 2), cosine=(0, 0)),
)
