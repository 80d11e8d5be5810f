"""Relative motion of the two frames of a joint, and quaternions, for joint types."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexclear.dynamics.vectors import AT_REST, Matrix, Twist, Vector


class Relative(NamedTuple):
    """Pose of frame G in F, motion of G per unit of each speed, and the part of its acceleration that speeds cause.

    All is in axes of F. A joint moves G by the twist S u, whose rate is S u' + bias.
    """

    R_FG: Matrix
    p_FG: Vector
    S: Sequence[Twist]
    bias: Twist = AT_REST


def rates_are_speeds(x: Any, u: Any) -> Any:
    """Return the rates of positions that change at the speeds."""
    return u


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
