"""Joints that rotate about z or y of the first frame, slide along its axes, or do both, as their coordinates say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexclear.dynamics.joints.coordinate import ROTATION, ROTATION_Y, TRANSLATION, Coordinate
from flexclear.dynamics.joints.relative import Relative, rates_are_speeds
from flexclear.dynamics.specialise.symbols import cos, sin
from flexclear.dynamics.vectors import AXES, UNIT, ZERO, Matrix, Twist, Vector

#: stands for the turn among the axes of slides
TURN = -1


@dataclass(frozen=True)
class Joint:
    """Interface of a joint type (see `joints`), made for its coordinates."""

    COORDINATES: tuple[Coordinate, ...]
    POSITIONS: str
    SPEEDS: str
    TRANSLATIONS: tuple[int, ...]
    ROTATIONS: tuple[tuple[int, int], ...]
    motion: Callable[[Any, Any], Relative]
    position_rate: Callable[[Any, Any], Any] = rates_are_speeds


def joint(*coordinates: Coordinate) -> Joint:
    """Build the joint that leaves these coordinates free, at most one of which is an angle."""
    places = {TURN if one.turning else one.axis: k for k, one in enumerate(coordinates)}
    turned = next((one.axis for one in coordinates if one.turning), 2)
    about = about_y if turned == 1 else about_z
    S = [Twist(AXES[one.axis], ZERO) if one.turning else Twist(ZERO, AXES[one.axis]) for one in coordinates]

    def motion(x: Any, u: Any) -> Relative:
        """Return the motion of G in F; eqs. (30), (31) for a slide along one axis."""
        R_FG = about(x[places[TURN]]) if TURN in places else UNIT
        return Relative(R_FG, Vector([x[places[axis]] if axis in places else 0.0 for axis in range(3)]), S)

    letters = "".join("r" if one.turning else "t" for one in coordinates)
    held = tuple(axis for axis in range(3) if axis not in places)
    across = tuple((turned, other) for other in range(3) if other != turned)
    perpendicular = across if TURN in places else ((0, 1), (1, 2), (2, 0))
    return Joint(coordinates, letters, letters, held, perpendicular, motion)


def about_z(angle: Any) -> Matrix:
    """Return the rotation about z by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return Matrix([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])


def about_y(angle: Any) -> Matrix:
    """Return the rotation about y by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return Matrix([c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c])


#: in the tree only where one of the two bodies is flexible
FIXED = joint()
REVOLUTE, PRISMATIC, CYLINDRICAL = joint(ROTATION), joint(TRANSLATION), joint(ROTATION, TRANSLATION)
#: a pin in a slot along x
SLOT = joint(Coordinate("translation", False, axis=0), ROTATION)
PLANAR = joint(Coordinate("x", False, axis=0), Coordinate("y", False, axis=1), ROTATION)
#: a slider along z that is loose along x
GUIDED = joint(TRANSLATION, Coordinate("x", False, axis=0), ROTATION_Y)
