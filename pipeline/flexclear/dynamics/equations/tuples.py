"""Vector and rotation algebra for kernels, on tuples that stay in registers.

A vector is ``(x, y, z)``, a matrix its nine entries row by row.
"""

from __future__ import annotations

from flexclear.dynamics.kernels import kernel

ZERO, IDENTITY = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def put(a, i, v):
    """Store a vector from index i."""
    a[i], a[i + 1], a[i + 2] = v[0], v[1], v[2]


@kernel
def at6(a, i):
    """Return the symmetric matrix (xx, yy, zz, xy, xz, yz) stored from index i."""
    return (a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5])


@kernel
def add(a, b):
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


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
def turn_symmetric(s, v):
    """Return S v of a symmetric S = (xx, yy, zz, xy, xz, yz)."""
    return (
        s[0] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[3] * v[0] + s[1] * v[1] + s[5] * v[2],
        s[4] * v[0] + s[5] * v[1] + s[2] * v[2],
    )
