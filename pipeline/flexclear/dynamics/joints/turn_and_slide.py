"""Joints that rotate about z or y of the first frame, slide along its axes, or do both, as their coordinates say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexclear.dynamics.joints.coordinate import (
    ROTATION,
    ROTATION_Y,
    TRANSLATION,
    Coordinate,
    angle_about,
    rates_are_speeds,
)
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import IDENTITY, ZERO, about_y, about_z


@dataclass(frozen=True)
class Joint:
    """Interface of a joint type (see `joints`), with kernels made for its coordinates."""

    COORDINATES: tuple[Coordinate, ...]
    POSITIONS: str
    SPEEDS: str
    TRANSLATIONS: tuple[int, ...]
    ROTATIONS: tuple[tuple[int, int], ...]
    motion: Callable
    position_rate: Callable

    def coordinates(self, R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return angles [rad] in (-pi, pi] and displacements [m] of a relative pose, one per coordinate."""
        return np.array([angle_about(R, one.axis) if one.turning else p[one.axis] for one in self.COORDINATES])


def joint(*coordinates: Coordinate) -> Joint:
    """Build the joint that leaves these coordinates free, at most one of which is an angle."""
    count, places = len(coordinates), {-1 if one.turning else one.axis: k for k, one in enumerate(coordinates)}
    turn, x, y, z = (places.get(place, -1) for place in (-1, 0, 1, 2))
    ones = (*(6 * k + (0 if one.turning else 3) + one.axis for k, one in enumerate(coordinates)), 0)
    axis = coordinates[turn].axis if turn >= 0 else 2
    about = about_y if axis == 1 else about_z

    @kernel
    def motion(w, q, u, S):
        """Compute the motion of G in F (see `spherical.motion`); eqs. (30), (31) for a slide along one axis."""
        for k in range(6 * count):
            w[S + k] = 0.0
        for k in range(count):
            w[S + ones[k]] = 1.0
        R = about(w[q + turn]) if turn >= 0 else IDENTITY
        p = (w[q + x] if x >= 0 else 0.0, w[q + y] if y >= 0 else 0.0, w[q + z] if z >= 0 else 0.0)
        return R, p, ZERO, ZERO

    letters = "".join("r" if one.turning else "t" for one in coordinates)
    held = tuple(axis for axis in range(3) if axis not in places)
    turned = tuple((axis, other) for other in range(3) if other != axis)
    perpendicular = turned if turn >= 0 else ((0, 1), (1, 2), (2, 0))
    return Joint(coordinates, letters, letters, held, perpendicular, motion, rates_are_speeds(count))


#: in the tree only where one of the two bodies is flexible
FIXED = joint()
REVOLUTE, PRISMATIC, CYLINDRICAL = joint(ROTATION), joint(TRANSLATION), joint(ROTATION, TRANSLATION)
#: a pin in a slot along x
SLOT = joint(Coordinate("translation", False, axis=0), ROTATION)
PLANAR = joint(Coordinate("x", False, axis=0), Coordinate("y", False, axis=1), ROTATION)
#: a slider along z that is loose along x
GUIDED = joint(TRANSLATION, Coordinate("x", False, axis=0), ROTATION_Y)
