"""Joint types of the tree: a table. Of the frame G on the second body in the frame F on the first one.

All is in axes of F. A joint moves G by the twist S u, whose rate is S u' + bias; its positions x change at a rate that
follows from x and the speeds u.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.mechanics.vectors import AT_REST, AXES, UNIT, ZERO, Matrix, Twist, Vector, cross, dot, skew
from flexclear.dynamics.routines.symbols import branch, cos, sin, sqrt

#: squared angle [rad^2] below which functions of rotation vectors come from their series; the next terms are below
#: rounding there
SERIES_ANGLE = 1e-2
TURN, TURN_Y = "turn", "turn about y"


class Relative(NamedTuple):
    """Pose of G in F, motion of G per unit of each speed, and the part of its acceleration that speeds cause."""

    R_FG: Matrix
    p_FG: Vector
    S: Sequence[Twist]
    bias: Twist = AT_REST


class Joint(NamedTuple):
    """A joint type. motion: Relative of positions and speeds.  rate: of the positions, more by `redundant`."""

    motion: Callable[[Any, Any], Relative]
    rate: Callable[[Any, Any], Any] = lambda x, u: u
    redundant: int = 0


def about_z(angle: Any) -> Matrix:
    """Return the rotation about z by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return Matrix([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])


def about_y(angle: Any) -> Matrix:
    """Return the rotation about y by an angle [rad]."""
    c, s = cos(angle), sin(angle)
    return Matrix([c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c])


def from_quaternion(q: Any) -> Matrix:
    """Return the rotation of a quaternion (w x y z) of any norm."""
    w, x, y, z = q
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return Matrix(
        [
            *(1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
            *(s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
            *(s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
        ]
    )


def quaternion_rate(q: Any, omega: Any) -> list[Any]:
    """Return the rate of a quaternion of R_FG at an angular velocity in axes of F."""
    w, (x, y, z) = q[0], q[1:]
    p, r, s = (0.5 * one for one in omega)
    return [-(p * x + r * y + s * z), p * w + r * z - s * y, r * w + s * x - p * z, s * w + p * y - r * x]


def along(*coordinates: int | str) -> Callable[[Any, Any], Relative]:
    """Return the motion with these coordinates: slides along axes of F, and a turn about its z or y."""
    turns = {TURN: AXES[2], TURN_Y: AXES[1]}
    S = [Twist(turns[one], ZERO) if one in turns else Twist(ZERO, AXES[int(one)]) for one in coordinates]

    def motion(x: Any, u: Any) -> Relative:
        at = dict(zip(coordinates, x, strict=True))
        R_FG = about_z(at[TURN]) if TURN in at else about_y(at[TURN_Y]) if TURN_Y in at else UNIT
        return Relative(R_FG, Vector([at.get(axis, 0.0) for axis in range(3)]), S)

    return motion


def by_two_turns(x: Any, u: Any) -> Relative:
    """Return the motion of a universal joint: a turn about x of F, then one about y of the turned frame."""
    (ca, sa), (cb, sb) = ((cos(angle), sin(angle)) for angle in x)
    first, second = AXES[0], Vector([0.0, ca, sa])
    R_FG = Matrix([cb, 0.0, sb, sa * sb, ca, -sa * cb, -ca * sb, sa, ca * cb])
    return Relative(
        R_FG, ZERO, [Twist(first, ZERO), Twist(second, ZERO)], Twist(u[0] * u[1] * cross(first, second), ZERO)
    )


def by_quaternion(q: Any, u: Any) -> Relative:
    """Return the motion of a ball joint; speeds: angular velocity."""
    return Relative(from_quaternion(q), ZERO, [Twist(axis, ZERO) for axis in AXES])


def freely(x: Any, u: Any) -> Relative:
    """Return the motion of a body without joint: quaternion and position; speeds: angular velocity and velocity."""
    S = [*(Twist(axis, ZERO) for axis in AXES), *(Twist(ZERO, axis) for axis in AXES)]
    return Relative(from_quaternion(x[:4]), Vector(x[4:]), S)


def by_rotation_vector(x: Any, u: Any) -> Relative:
    """Return the motion by a rotation vector: omega = T(x) u; singular at angles of 2 pi.

    Source: Bauchau (2011), Flexible Multibody Dynamics, sec. 13.3.
    """
    x, u = Vector(x), Vector(u)
    s = dot(x, x)
    R_FG, T, bias = rotation(x, u, branch(s < SERIES_ANGLE, lambda: series(s), lambda: _closed(s)))
    return Relative(R_FG, ZERO, [Twist(T.column(k), ZERO) for k in range(3)], Twist(bias, ZERO))


def rotation(x: Vector, u: Vector, coefficients: Sequence[Any]) -> tuple[Matrix, Matrix, Vector]:
    """Return the rotation by a vector x of rate u, T with omega = T u, and the rate of omega at constant u.

    coefficients: at the squared angle, see `series`.
    """
    X, ds, xu = skew(x), 2.0 * dot(x, u), cross(x, u)
    c, a, b, da, db = coefficients
    bias = da * ds * xu + db * ds * cross(x, xu) + b * cross(u, xu)
    return UNIT + c * X + a * (X @ X), UNIT + a * X + b * (X @ X), bias


def _closed(s: Any) -> tuple[Any, ...]:
    angle = sqrt(s)
    c, half = sin(angle) / angle, sin(0.5 * angle)
    a = 2.0 * half * half / s
    b = (1.0 - c) / s
    return c, a, b, (0.5 * c - a) / s, (0.5 * a - 1.5 * b) / s


def series(s: Any) -> tuple[Any, ...]:
    """Return sin/angle, a = (1 - cos)/angle^2, b = (angle - sin)/angle^3 and the rates of a and b by s = angle^2.

    They are exact below about one radian.
    """
    c = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0))))
    a = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0)))))
    b = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
    da = -(1.0 - s / 15.0 * (1.0 - s * 3.0 / 112.0 * (1.0 - s * 2.0 / 135.0))) / 24.0
    db = -(1.0 - s / 21.0 * (1.0 - s / 48.0 * (1.0 - s * 2.0 / 165.0))) / 120.0
    return c, a, b, da, db


JOINTS = {
    "fixed": Joint(along()),
    "revolute": Joint(along(TURN)),
    "prismatic": Joint(along(2)),
    "cylindrical": Joint(along(TURN, 2)),
    "slot": Joint(along(0, TURN)),
    "planar": Joint(along(0, 1, TURN)),
    "guided": Joint(along(2, 0, TURN_Y)),
    "universal": Joint(by_two_turns),
    "spherical": Joint(by_quaternion, quaternion_rate, 1),
    "rotation-vector": Joint(by_rotation_vector),
    "free": Joint(freely, lambda x, u: [*quaternion_rate(x[:4], u[:3]), *u[3:]], 1),
}
