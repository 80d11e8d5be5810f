r"""Elastic mount between two frames F and G: stiffness and damping for six displacements.

.. math:: s = (x, \theta), \quad x = R_{WF}^T(p_G - p_F), \quad R_{FG} = \exp\tilde\theta, \quad
          U = \tfrac12 s^TKs, \quad P_{lost} = \dot s^TC\dot s

The skew-symmetric part of an unsymmetric K has no potential; its power :math:`\tfrac12\dot s^T(K^T-K)s` is work of the
load. With :math:`K_{xy} = k_c = -K_{yx}` that work is 2 k_c times the area of a closed path, counter-clockwise.

The force on G is -(K s + C ds/dt) along x; the torque along theta becomes one about the axes of F by the inverse
tangent, :math:`T^{-T} = 1 + \tfrac12\tilde\theta + e\,\tilde\theta\tilde\theta`,
:math:`e = (1 - \tfrac\theta2\cot\tfrac\theta2)/\theta^2`, so that power and energy agree for finite rotations. They act
at the origin of G. The rotation vector is the shortest one at the start and continuous from there; its last value is an
internal state; at a full turn it has no direction, and the right-hand side is not a number, which ends the run. A
bushing without stiffness and damping against rotation has no such state and may turn without limit.

Source: Bauchau (2011), Flexible Multibody Dynamics, sec. 13.3 (rotation vector and tangent).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexclear.dynamics.joints.conditions import twist_between
from flexclear.dynamics.loads.given import Given, Load
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.specialise.symbols import arctan2, branch, cos, larger, sin, sqrt
from flexclear.dynamics.vectors import Matrix, Vector, Wrench, cross, dot
from flexclear.scene.loads import Bushing

#: number of its internal states, if any
STATES = 3
#: angle^2 below which e comes from its series; the next term is 1e-13 there
SERIES_BELOW = 1e-3
#: square of the angle [rad] from which on the torque is undefined; 6.2 of 2 pi
FULL = 6.2**2


def apply(given: Given) -> Load:
    """Return the wrench; power: of the unsymmetric stiffness."""
    K, C, circulating = (given.numbers[k : k + 36] for k in (0, 36, 72))
    F, G, before = given.F, given.G, given.states
    R_FW, r = F.R_WB.T, G.p_WB - F.p_WB
    x, (spin, x_rate) = R_FW @ r, twist_between(F, G).seen(R_FW)
    theta = rotation_vector(R_FW @ G.R_WB)
    theta = continued(theta, Vector(before)) if before else theta
    e = tangent_part(theta)

    def turned(v: Vector, half: float) -> Vector:
        """Return T^-1 v for half = -0.5, T^-T v for 0.5."""
        swung = cross(theta, v)
        return v + half * swung + e * cross(theta, swung)

    theta_rate = turned(spin, -0.5)
    s, s_rate = [*x, *theta], [*x_rate, *theta_rate]
    elastic, damped = _product(K, s), _product(C, s_rate)
    along = [-(one + other) for one, other in zip(elastic, damped, strict=True)]
    wrench = Wrench(F.R_WB @ turned(Vector(along[3:]), 0.5), F.R_WB @ Vector(along[:3]))
    power, rates = _dot(_product(circulating, s), s_rate), theta_rate if before else ()
    return Load(wrench, power, _dot(damped, s_rate), rates, stored=0.5 * _dot(elastic, s))


def rotation_vector(R: Matrix) -> Vector:
    """Return the shortest rotation vector [rad] of a rotation matrix, from its quaternion."""
    w, *axis = to_quaternion(R)
    axis = branch(w >= 0.0, lambda: Vector(axis), lambda: -Vector(axis))
    size, cosine = sqrt(dot(axis, axis)), abs(w)
    return branch(size > 0.0, lambda: 2.0 * arctan2(size, cosine) / size, lambda: 2.0 / cosine) * axis


def to_quaternion(R: Matrix) -> tuple[Any, ...]:
    """Return a quaternion (w, x, y, z) of a rotation matrix by its largest component, of any norm (Shepperd 1978)."""
    xx, yy, zz = R[0], R[4], R[8]
    w, x, y, z = 1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz
    wx, wy, wz = R[7] - R[5], R[2] - R[6], R[3] - R[1]
    xy, yz, zx = R[1] + R[3], R[5] + R[7], R[2] + R[6]
    most, more = larger(x, larger(y, z)), larger(y, z)

    # four times the products of one component with all four
    def turned_far() -> Any:
        return branch(x >= more, lambda: (wx, x, xy, zx), lambda: branch(y >= z, lambda: (wy, xy, y, yz), last))

    def last() -> Any:
        return wz, zx, yz, z

    return branch(w >= most, lambda: (w, wx, wy, wz), turned_far)


def continued(v: Vector, before: Vector) -> Vector:
    """Return that rotation vector below a full turn with the same rotation as v which is closer to `before`."""
    size = sqrt(dot(v, v))

    def nearer() -> Vector:
        other = (1.0 - 2.0 * np.pi / size) * v
        left, right = v - before, other - before
        return branch(dot(left, left) <= dot(right, right), lambda: v, lambda: within_a_turn(other))

    return branch(size == 0.0, lambda: v, nearer)


def within_a_turn(v: Vector) -> Vector:
    """Return a rotation vector, not a number where it is not below a full turn: this ends the run."""
    beyond = dot(v, v) - FULL
    return branch(beyond < 0.0, lambda: v, lambda: sqrt(-1.0 - beyond) * v)


def tangent_part(v: Vector) -> Any:
    """Return the factor e of the inverse tangent."""
    s = dot(v, v)

    def closed() -> Any:
        half = 0.5 * sqrt(s)
        return (1.0 - half * cos(half) / sin(half)) / s

    return branch(s < SERIES_BELOW, lambda: (1.0 + s / 60.0 * (1.0 + s / 42.0 * (1.0 + s / 40.0))) / 12.0, closed)


def _product(A: Sequence[Any], s: Sequence[Any]) -> list[Any]:
    """Return a 6x6 matrix times six numbers."""
    return [_dot(A[k : k + 6], s) for k in range(0, 36, 6)]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)


def row(load: Bushing, path: str) -> Row:
    """Return the load's row: stiffness, damping, circulatory matrix, row by row [SI]; three states where it feels
    rotation."""
    K, C = np.array(load.stiffness), np.array(load.damping)
    numbers = np.concatenate([K, C, 0.5 * (K.T - K)]).ravel()
    turning = any(np.any(matrix[3:]) or np.any(matrix[:, 3:]) for matrix in (K, C))
    return Row(frames=load.between, numbers=tuple(numbers.tolist()), states=STATES if turning else 0)
