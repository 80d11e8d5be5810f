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

import numpy as np

from flexclear.dynamics.gauge import internal_rate, relative_twist
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.loads.fields import act, number
from flexclear.dynamics.loads.row import Row
from flexclear.dynamics.vectors import (
    add,
    at,
    cross,
    dot,
    product,
    put,
    scale,
    sub,
    to_quaternion,
    transpose,
    turn,
    turn_back,
)
from flexclear.scene.loads import Bushing

#: angle^2 below which e comes from its series; the next term is 1e-13 there
SERIES_BELOW = 1e-3
#: square of the angle [rad] from which on the torque is undefined; 6.2 of 2 pi
FULL = 6.2**2
#: offsets of the damping matrix and of the circulatory one, (K^T - K)/2, among the numbers, and of the blocks of a 6x6
#: matrix
DAMPING, CIRCULATION, MIXED, SECOND = 36, 72, 3, 18


@kernel
def rotation_vector(R):
    """Return the shortest rotation vector [rad] of a rotation matrix, from its quaternion."""
    q = to_quaternion(R)
    axis = (q[1], q[2], q[3]) if q[0] >= 0.0 else (-q[1], -q[2], -q[3])
    size, cosine = np.sqrt(dot(axis, axis)), abs(q[0])
    return scale(2.0 * np.arctan2(size, cosine) / size if size > 0.0 else 2.0 / cosine, axis)


@kernel
def continued(v, before):
    """Return that rotation vector below a full turn with the same rotation as v which is closer to `before`."""
    size = np.sqrt(dot(v, v))
    if size == 0.0:
        return v
    other = scale(1.0 - 2.0 * np.pi / size, v)
    left, right = sub(v, before), sub(other, before)
    if dot(left, left) <= dot(right, right):
        return v
    beyond = dot(other, other) - FULL
    # not a number where neither is below a full turn: this ends the run
    return other if beyond < 0.0 else scale(np.sqrt(-1.0 - beyond), other)


@kernel
def tangent_part(v):
    """Return the factor e of the inverse tangent."""
    s = dot(v, v)
    if s < SERIES_BELOW:
        return (1.0 + s / 60.0 * (1.0 + s / 42.0 * (1.0 + s / 40.0))) / 12.0
    half = 0.5 * np.sqrt(s)
    return (1.0 - half * np.cos(half) / np.sin(half)) / s


@kernel
def times(d, k, first, v):
    """Return v times a 3x3 block of a matrix of load k, whose first entry is at `first`."""
    return (
        number(d, k, first) * v[0] + number(d, k, first + 1) * v[1] + number(d, k, first + 2) * v[2],
        number(d, k, first + 6) * v[0] + number(d, k, first + 7) * v[1] + number(d, k, first + 8) * v[2],
        number(d, k, first + 12) * v[0] + number(d, k, first + 13) * v[1] + number(d, k, first + 14) * v[2],
    )


@kernel
def product6(d, k, first, x, v):
    """Return both halves of a 6x6 matrix of load k times (x, v)."""
    upper = add(times(d, k, first, x), times(d, k, first + MIXED, v))
    lower = add(times(d, k, first + SECOND, x), times(d, k, first + SECOND + MIXED, v))
    return upper, lower


@kernel
def apply(d, k):
    """Apply the force of load k."""
    load = d.loads[k]
    a, b = d.site_frames[load.a], d.site_frames[load.b]
    F, G, p = a.axes, b.axes, b.origin
    r, (turning, slide) = sub(p, a.origin), relative_twist(a, b)
    spin = turn_back(F, turning)
    x, x_rate, v = turn_back(F, r), turn_back(F, slide), rotation_vector(product(transpose(F), G))
    if load.internal0 >= 0:
        v = continued(v, at(d.internal, load.internal0))
    e = tangent_part(v)
    crossed = cross(v, spin)
    v_rate = add(spin, add(scale(-0.5, crossed), scale(e, cross(v, crossed))))
    if load.internal0 >= 0:
        put(d.ledger_rate, internal_rate(d, load.internal0), v_rate)
    pull, twist = product6(d, k, 0, x, v)
    damped_pull, damped_twist = product6(d, k, DAMPING, x_rate, v_rate)
    stored, lost = 0.5 * (dot(pull, x) + dot(twist, v)), dot(damped_pull, x_rate) + dot(damped_twist, v_rate)
    circling, swirling = product6(d, k, CIRCULATION, x, v)
    power = dot(circling, x_rate) + dot(swirling, v_rate)
    force = turn(F, scale(-1.0, add(pull, damped_pull)))
    along = scale(-1.0, add(twist, damped_twist))
    swung = cross(v, along)
    torque = turn(F, add(along, add(scale(0.5, swung), scale(e, cross(v, swung)))))
    length = np.sqrt(dot(r, r))
    rate = dot(r, slide) / length if length > 0.0 else 0.0
    act(d, k, add(torque, cross(p, force)), force, length, rate, stored, power, lost)


def row(load: Bushing, path: str) -> Row:
    """Return the load's row: stiffness, damping, circulatory matrix, row by row [SI]; three states where it feels
    rotation."""
    K, C = np.array(load.stiffness), np.array(load.damping)
    numbers = np.concatenate([K, C, 0.5 * (K.T - K)]).ravel()
    turning = any(np.any(matrix[3:]) or np.any(matrix[:, 3:]) for matrix in (K, C))
    return Row(frames=load.between, numbers=tuple(numbers.tolist()), states=3 if turning else 0)
