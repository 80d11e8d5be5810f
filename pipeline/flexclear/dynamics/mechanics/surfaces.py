"""Surfaces of contacts: a table. How far an inner one (ball, pin) is from an outer one (socket, journal, plane).

p, v: centre of the inner surface as seen from that of the outer one, and its rate there, in axes of the world.  R_WA:
axes of the outer frame.  numbers: of the contact (`memory.CONTACT_NUMBERS`).
Source: Wang & Wang (2019), eqs. (19) to (22).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexclear.dynamics.mechanics.vectors import AXES, ZERO, Matrix, Vector, dot
from flexclear.dynamics.routines.symbols import branch, copysign, select, sqrt


class Separation(NamedTuple):
    """Gap [m] and approach, the rate of penetration; normal of the outer surface, and its rate as seen from there.

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


def ball_in_socket(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation along the line of centres; any direction serves where they coincide."""
    distance = sqrt(dot(p, p))

    def line_of_centres() -> tuple[Vector, Vector]:
        n = (1.0 / distance) * p
        return n, (1.0 / distance) * across(n, v)

    normal, turning = branch(distance > 0.0, line_of_centres, lambda: (AXES[2], ZERO))
    return Separation(numbers.clearance - distance, dot(normal, v), normal, turning, p)


def circle_in_circle(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation in the plane across the journal's axis z."""
    z = R_WA.column(2)
    return ball_in_socket(numbers, R_WA, across(z, p), across(z, v))._replace(offset=p)


def pin_in_slot(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation from two walls along x, and from a half circle at each end of the straight part."""
    x, z, half = R_WA.column(0), R_WA.column(2), numbers.shape[0]
    along = dot(x, p)
    between = abs(along) <= half
    guided = select(between, along, copysign(half, along)) * x  # the centre line's nearest point
    moving = select(between, dot(x, v), 0.0) * x
    return ball_in_socket(numbers, R_WA, across(z, p) - guided, across(z, v) - moving)


def ball_on_plane(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation from the plane xy, out of which z points towards the ball."""
    z = R_WA.column(2)
    height = dot(z, p)
    return Separation(height - numbers.radius, -dot(z, v), -z, ZERO, height * z)


SURFACES = {
    "clearance-spherical": ball_in_socket,
    "clearance-revolute": circle_in_circle,
    "clearance-slot": pin_in_slot,
    "ball-on-plane": ball_on_plane,
}
