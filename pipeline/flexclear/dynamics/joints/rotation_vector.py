r"""Rotation by a rotation vector x, as a prescribed path may give it: R_FG = exp(x~), with the rate dx/dt.

.. math:: \omega = T(x)\dot x, \quad T = 1 + a\,\tilde x + b\,\tilde x\tilde x, \quad
          a = \frac{1 - \cos\phi}{\phi^2},\; b = \frac{\phi - \sin\phi}{\phi^3}

Singular at angles of 2 pi.  Source: Bauchau (2011), Flexible Multibody Dynamics, sec. 13.3.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.joints.coordinate import Coordinate
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, about, add, at, cross, dot, put, scale
from flexclear.numerics.rotations import matrix_to_quaternion


@kernel
def _functions(s):
    """Return sin/angle, a, b and the derivatives of a and b by s = angle^2."""
    # angle^2 below which the functions come from their series; their next terms are below rounding there
    if s < 1e-2:
        c = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0)))
        a = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0))))
        b = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
        da = -(1.0 - s / 15.0 * (1.0 - s * 3.0 / 112.0 * (1.0 - s * 2.0 / 135.0))) / 24.0
        db = -(1.0 - s / 21.0 * (1.0 - s / 48.0 * (1.0 - s * 2.0 / 165.0))) / 120.0
        return c, a, b, da, db
    angle = np.sqrt(s)
    c = np.sin(angle) / angle
    a = 2.0 * np.sin(0.5 * angle) ** 2 / s
    b = (1.0 - c) / s
    return c, a, b, (0.5 * c - a) / s, (0.5 * a - 1.5 * b) / s


@kernel
def motion(w, x, u, S):
    """Compute the motion of frame G in frame F: rotation vector from x (see `spherical.motion`)."""
    v, r = at(w, x), at(w, u)
    c, a, b, da, db = _functions(dot(v, v))
    for k in range(3):
        unit = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        vu = cross(v, unit)
        put(w, S + 6 * k, add(unit, add(scale(a, vu), scale(b, cross(v, vu)))))
        put(w, S + 6 * k + 3, ZERO)
    vr, ds = cross(v, r), 2.0 * dot(v, r)
    bias = add(add(scale(da * ds, vr), scale(db * ds, cross(v, vr))), scale(b, cross(r, vr)))
    return about(v, c, a), ZERO, bias, ZERO


@kernel
def position_rate(w, x, u, rate):
    """Store the rate of the vector, which is the speed."""
    put(w, rate, at(w, u))


POSITIONS, SPEEDS = "rrr", "rrr"  #: r: rotation [rad or -], t: translation [m]
TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
ROTATIONS: tuple[tuple[int, int], ...] = ()
COORDINATES: tuple[Coordinate, ...] = ()


def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the rotation vector [rad] of an angle up to pi, shape (3,)."""
    q = matrix_to_quaternion(R)
    half = np.linalg.norm(q[1:])
    return q[1:] * (2.0 if half == 0.0 else 2.0 * np.arctan2(half, q[0]) / half)
