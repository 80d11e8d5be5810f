"""Vector and rotation algebra for compiled kernels, on tuples that stay in registers.

A vector is ``(x, y, z)``, a matrix its nine entries row by row.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.kernels import kernel

ZERO, IDENTITY = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def at(a, i):
    """Return the vector stored in a flat array from index i."""
    return (a[i], a[i + 1], a[i + 2])


@kernel
def put(a, i, v):
    """Store a vector from index i."""
    a[i], a[i + 1], a[i + 2] = v[0], v[1], v[2]


@kernel
def accumulate(a, i, v):
    """Add a vector to the one stored from index i."""
    a[i] += v[0]
    a[i + 1] += v[1]
    a[i + 2] += v[2]


@kernel
def at9(a, i):
    """Return the matrix stored in a flat array from index i."""
    return (a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5], a[i + 6], a[i + 7], a[i + 8])


@kernel
def at6(a, i):
    """Return the symmetric matrix (xx, yy, zz, xy, xz, yz) stored from index i."""
    return (a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5])


@kernel
def put6(a, i, s):
    """Store a symmetric matrix (xx, yy, zz, xy, xz, yz) from index i."""
    put(a, i, (s[0], s[1], s[2]))
    put(a, i + 3, (s[3], s[4], s[5]))


@kernel
def add(a, b):
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def add6(a, b):
    """Return a + b for symmetric matrices."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@kernel
def add9(a, b):
    """Return a + b for matrices."""
    return (
        *(a[0] + b[0], a[1] + b[1], a[2] + b[2]),
        *(a[3] + b[3], a[4] + b[4], a[5] + b[5]),
        *(a[6] + b[6], a[7] + b[7], a[8] + b[8]),
    )


@kernel
def sub(a, b):
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@kernel
def scale(s, a):
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@kernel
def dot(a, b):
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def dot_wrench(wrench, twist):
    """Return the product of a row with moment and force and a row with angular and linear part."""
    return dot(wrench.moment, twist.angular) + dot(wrench.force, twist.linear)


@kernel
def add_wrench(row, moment, force):
    """Add to the moment and the force of a row."""
    row.moment = add(row.moment, moment)
    row.force = add(row.force, force)


@kernel
def add_twist(row, angular, linear):
    """Add to the angular and the linear part of a row."""
    row.angular = add(row.angular, angular)
    row.linear = add(row.linear, linear)


@kernel
def radial(p, v):
    """Return the length of p, its rate for the rate v of p, the direction of p, and the direction's rate."""
    distance = np.sqrt(dot(p, p))
    # a zero vector has no direction; any direction serves its users
    known = distance > 0.0
    direction = scale(1.0 / distance, p) if known else (0.0, 0.0, 1.0)
    rate = dot(direction, v)
    turning = scale(1.0 / distance, sub(v, scale(rate, direction))) if known else (0.0, 0.0, 0.0)
    return distance, rate, direction, turning


@kernel
def cross(a, b):
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def turn(m, v):
    """Return m v."""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


@kernel
def turn_back(m, v):
    """Return m^T v."""
    return (
        m[0] * v[0] + m[3] * v[1] + m[6] * v[2],
        m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
        m[2] * v[0] + m[5] * v[1] + m[8] * v[2],
    )


@kernel
def product(a, b):
    """Return a b."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@kernel
def transpose(a):
    """Return a^T."""
    return (a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8])


@kernel
def axis(m, k):
    """Return column k of a matrix: axis k of the frame."""
    return (m[k], m[3 + k], m[6 + k])


@kernel
def from_quaternion(w, x, y, z):
    """Return the rotation matrix of a quaternion of any norm."""
    s = 2.0 / (w * w + x * x + y * y + z * z)
    return (
        1.0 - s * (y * y + z * z),
        s * (x * y - w * z),
        s * (x * z + w * y),
        s * (x * y + w * z),
        1.0 - s * (x * x + z * z),
        s * (y * z - w * x),
        s * (x * z - w * y),
        s * (y * z + w * x),
        1.0 - s * (x * x + y * y),
    )


@kernel
def to_quaternion(R):
    """Return a quaternion (w, x, y, z) of a rotation matrix by its largest component, of any norm (Shepperd 1978)."""
    xx, yy, zz = R[0], R[4], R[8]
    w, x, y, z = 1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz
    wx, wy, wz = R[7] - R[5], R[2] - R[6], R[3] - R[1]
    xy, yz, zx = R[1] + R[3], R[5] + R[7], R[2] + R[6]
    # four times the products of one component with all four
    if w >= x and w >= y and w >= z:
        x, y, z = wx, wy, wz
    elif x >= y and x >= z:
        w, y, z = wx, xy, zx
    elif y >= z:
        w, x, z = wy, xy, yz
    else:
        w, x, y = wz, zx, yz
    return w, x, y, z


@kernel
def about_y(angle):
    """Return the rotation matrix of a rotation about y [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return (c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)


@kernel
def about_z(angle):
    """Return the rotation matrix of a rotation about z [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return (c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)


@kernel
def quaternion_rate(a, q, u, rate):
    """Store the rate of the quaternion stored from q at the angular velocity stored from u, parent axes."""
    e, x, y, z = a[q], a[q + 1], a[q + 2], a[q + 3]
    p, r, s = a[u], a[u + 1], a[u + 2]
    a[rate] = -0.5 * (p * x + r * y + s * z)
    a[rate + 1] = 0.5 * (p * e + r * z - s * y)
    a[rate + 2] = 0.5 * (r * e + s * x - p * z)
    a[rate + 3] = 0.5 * (s * e + p * y - r * x)


@kernel
def congruence(R, s):
    """Return R S R^T of a symmetric S = (xx, yy, zz, xy, xz, yz), in the same order."""
    a = product(R, (s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2]))
    return (
        a[0] * R[0] + a[1] * R[1] + a[2] * R[2],
        a[3] * R[3] + a[4] * R[4] + a[5] * R[5],
        a[6] * R[6] + a[7] * R[7] + a[8] * R[8],
        a[0] * R[3] + a[1] * R[4] + a[2] * R[5],
        a[0] * R[6] + a[1] * R[7] + a[2] * R[8],
        a[3] * R[6] + a[4] * R[7] + a[5] * R[8],
    )


@kernel
def turn_symmetric(s, v):
    """Return S v of a symmetric S = (xx, yy, zz, xy, xz, yz)."""
    return (
        s[0] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[3] * v[0] + s[1] * v[1] + s[5] * v[2],
        s[4] * v[0] + s[5] * v[1] + s[2] * v[2],
    )


@kernel
def about(v, a, b):
    """Return the matrix that maps x to x + a v x x + b v x (v x x)."""
    x, y, z = v
    return (
        1.0 - b * (y * y + z * z),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        1.0 - b * (x * x + z * z),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        1.0 - b * (x * x + y * y),
    )


@kernel
def exponential(v):
    """Return the rotation matrix of a rotation vector below about one radian (Rodrigues, in series)."""
    s = dot(v, v)
    a = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0))))
    b = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0)))))
    return about(v, a, b)


@kernel
def _tangent_series(s):
    """Return (1 - cos)/s and (sqrt s - sin)/s^1.5 at s = angle^2, and their derivatives in s."""
    a = 0.5 * (1.0 - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0)))))
    b = (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))) / 6.0
    da = -(1.0 - s / 15.0 * (1.0 - s / 37.333333333333336 * (1.0 - s / 67.5))) / 24.0
    db = -(1.0 - s / 21.0 * (1.0 - s / 48.0 * (1.0 - s / 82.5))) / 120.0
    return a, b, da, db


@kernel
def tangent(v, x):
    """Return the angular velocity, parent axes, of the rotation exp(v) when v changes at the rate x."""
    a, b, _, _ = _tangent_series(dot(v, v))
    vx = cross(v, x)
    vvx = cross(v, vx)
    return add(x, add(scale(a, vx), scale(b, vvx)))


@kernel
def tangent_matrix(v):
    """Return the matrix of `tangent`: x to angular velocity."""
    s = dot(v, v)
    a, b, _, _ = _tangent_series(s)
    return about(v, a, b)


@kernel
def tangent_rate(v, x):
    """Return the angular acceleration of exp(v) at constant rate x of v: d/dt of `tangent`."""
    _, b, da, db = _tangent_series(dot(v, v))
    ds = 2.0 * dot(v, x)
    vx = cross(v, x)
    vvx = cross(v, vx)
    return add(add(scale(da * ds, vx), scale(db * ds, vvx)), scale(b, cross(x, vx)))
