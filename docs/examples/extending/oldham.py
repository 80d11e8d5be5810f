"""An Oldham coupling: the second frame slides along x and y of the first and does not turn in it."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.joints.relative import Relative, rates_are_speeds
from flexclear.dynamics.vectors import AXES, UNIT, ZERO, Twist, Vector


def motion(x: Any, u: Any) -> Relative:
    """Motion of frame G in frame F: metres along x, then along y."""
    return Relative(UNIT, Vector([*x, 0.0]), [Twist(ZERO, axis) for axis in AXES[:2]])


position_rate = rates_are_speeds

POSITIONS, SPEEDS = "tt", "tt"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (2,)
ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 0))
COORDINATES = (Coordinate("x", False, axis=0), Coordinate("y", False, axis=1))
