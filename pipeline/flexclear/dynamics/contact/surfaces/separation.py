"""What surfaces of a contact have to say: how far the inner one (ball, pin) is from the outer one (socket, journal)."""

from __future__ import annotations

from typing import Any, NamedTuple

from flexclear.dynamics.specialise.symbols import branch, sqrt
from flexclear.dynamics.vectors import AXES, ZERO, Vector, dot


class Separation(NamedTuple):
    """Gap [m] and approach, the rate of penetration; normal towards the outer surface, and its rate as seen from there.

    offset: of the inner centre, which closes the gap.
    """

    gap: Any
    approach: Any
    normal: Vector
    turning: Vector
    offset: Vector


def across(normal: Vector, v: Vector) -> Vector:
    """Return the component of a vector across a unit vector."""
    return v - dot(normal, v) * normal


def nested(clearance: Any, p: Vector, v: Vector) -> Separation:
    """Return the separation along the line of centres; any direction serves where they coincide."""
    distance = sqrt(dot(p, p))

    def line_of_centres() -> tuple[Vector, Vector]:
        n = (1.0 / distance) * p
        return n, (1.0 / distance) * across(n, v)

    normal, turning = branch(distance > 0.0, line_of_centres, lambda: (AXES[2], ZERO))
    return Separation(clearance - distance, dot(normal, v), normal, turning, p)
