r"""Rotation by a rotation vector x, as a prescribed path may give it: R_FG = exp(x~), with the rate dx/dt.

.. math:: \omega = T(x)\dot x, \quad T = 1 + a\,\tilde x + b\,\tilde x\tilde x, \quad
          a = \frac{1 - \cos\phi}{\phi^2},\; b = \frac{\phi - \sin\phi}{\phi^3}

Singular at angles of 2 pi.  Source: Bauchau (2011), Flexible Multibody Dynamics, sec. 13.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.joints.relative import Relative, rates_are_speeds
from flexclear.dynamics.specialise.symbols import branch, sin, sqrt
from flexclear.dynamics.vectors import UNIT, ZERO, Matrix, Twist, Vector, cross, dot, skew
from flexclear.numerics.rotations import matrix_to_quaternion

#: squared angle [rad^2] below which functions of rotation vectors come from their series; the next terms are below
#: rounding there
SERIES_ANGLE = 1e-2


def motion(x: Any, u: Any) -> Relative:
    """Return the motion by a rotation vector."""
    x, u = Vector(x), Vector(u)
    s = dot(x, x)
    R_FG, T, bias = rotation(x, u, branch(s < SERIES_ANGLE, lambda: series(s), lambda: closed(s)))
    return Relative(R_FG, ZERO, [Twist(T.column(k), ZERO) for k in range(3)], Twist(bias, ZERO))


def rotation(x: Vector, u: Vector, coefficients: Sequence[Any]) -> tuple[Matrix, Matrix, Vector]:
    """Return the rotation by a vector x of rate u, T with omega = T u, and the rate of omega at constant u.

    coefficients: at the squared angle, see `series`.
    """
    X, ds, xu = skew(x), 2.0 * dot(x, u), cross(x, u)
    c, a, b, da, db = coefficients
    bias = da * ds * xu + db * ds * cross(x, xu) + b * cross(u, xu)
    return UNIT + c * X + a * (X @ X), UNIT + a * X + b * (X @ X), bias


def closed(s: Any) -> tuple[Any, ...]:
    """Return the same as `series`, away from s = 0."""
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


position_rate = rates_are_speeds

POSITIONS, SPEEDS = "rrr", "rrr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ()
COORDINATES: tuple[Coordinate, ...] = ()


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the rotation vector [rad] of an angle up to pi, shape (3,)."""
    q = matrix_to_quaternion(R)
    half = np.linalg.norm(q[1:])
    return q[1:] * (2.0 if half == 0.0 else 2.0 * np.arctan2(half, q[0]) / half)
