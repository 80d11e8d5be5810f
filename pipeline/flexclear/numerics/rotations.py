"""Rotations in NumPy, for data and set-up; the compiled kernels have their own functions on tuples.

SciPy's `Rotation` is not used: its import takes 0.6 s of processor time in every command. Quaternions are ``w x y z``;
matrices ``R_AB`` map components in B to components in A. The functions broadcast over leading dimensions unless they
say otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flexclear.numerics.axes import check_axes, check_axis

#: relative difference up to which values count as equal
_EQUAL = 1e-6

#: fraction of a rotation about other axes up to which it counts as a rotation about a fixed axis
OFF_AXIS = 1e-3


def index_of_largest(values: np.ndarray, axis: int = -1) -> np.ndarray:
    """Return the index of the largest of values >= 0 along an axis; of values equal up to rounding, the first.

    Rounding differs between processors, and must not decide the choice.
    """
    return np.argmax(values >= (1.0 - _EQUAL) * values.max(axis=axis, keepdims=True), axis=axis)


def skew(v: np.ndarray) -> np.ndarray:
    """Return the matrix of the cross product, ``skew(v) @ w == cross(v, w)``; shape (..., 3, 3)."""
    v = np.asarray(v, dtype=float)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def quaternion_to_matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a unit quaternion, shape (..., 3, 3)."""
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the vector product of arrays (..., 3) as `numpy.cross` does, in Fortran order.

    In this order each component of a long series is contiguous in memory.
    """
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), order="F")
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        np.multiply(a[..., i], b[..., j], out=out[..., k])
        out[..., k] -= a[..., j] * b[..., i]
    return out


def rotate(R: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return R v for arrays (..., 3, 3) and (..., 3), in Fortran order; see `cross`."""
    out = np.empty((*np.broadcast_shapes(R.shape[:-2], v.shape[:-1]), 3), order="F")
    for i in range(3):
        np.multiply(R[..., i, 0], v[..., 0], out=out[..., i])
        out[..., i] += R[..., i, 1] * v[..., 1]
        out[..., i] += R[..., i, 2] * v[..., 2]
    return out


def matrix_to_quaternion(R: np.ndarray) -> np.ndarray:
    """Return the unit quaternion of a rotation matrix, w >= 0, shape (..., 4), in Fortran order, for every angle."""
    R = np.asarray(R, dtype=float)
    trace = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    # rows of four times the products of each component with all four; the row with the largest square is normalised
    # (Shepperd 1978)
    squares = [1.0 + trace, *(1.0 + (2.0 * R[..., k, k] - trace) for k in range(3))]
    xy, yz, zx = (R[..., (k + 1) % 3, k] + R[..., k, (k + 1) % 3] for k in range(3))
    wx, wy, wz = (R[..., (k + 2) % 3, (k + 1) % 3] - R[..., (k + 1) % 3, (k + 2) % 3] for k in range(3))
    w, x, y, z = squares
    rows = ((w, wx, wy, wz), (wx, x, xy, zx), (wy, xy, y, yz), (wz, zx, yz, z))
    best, q = np.argmax(squares, axis=0), np.empty((*R.shape[:-2], 4), order="F")
    for largest, row in enumerate(rows):
        selected = best == largest
        for k in range(4):
            np.copyto(q[..., k : k + 1], row[k][..., None], where=selected[..., None])
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] >= 0.0, q, -q)


def without_sign_jumps(q: np.ndarray) -> np.ndarray:
    """Return unit quaternions (time, ..., 4) without jumps of sign; the sign of the first one stays."""
    flips = np.einsum("t...i,t...i->t...", q[1:], q[:-1]) < 0.0
    if flips.any():
        q = q.copy()
        q[1:] *= np.cumprod(np.where(flips, -1.0, 1.0), axis=0)[..., None]
    return q


def quaternion_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the Hamilton product; ``R(a b) = R(a) R(b)``."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    w = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    v = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([w, v], axis=-1)


def quaternion_conjugate(q: np.ndarray) -> np.ndarray:
    """Return the inverse rotation of a unit quaternion."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def rotation_vector_to_quaternion(v: np.ndarray) -> np.ndarray:
    """Return the quaternion of the rotation by ``|v|`` rad about ``v``; one vector, shape (4,)."""
    v = np.asarray(v, dtype=float)
    half = 0.5 * float(np.linalg.norm(v))
    return np.concatenate([[np.cos(half)], 0.5 * np.sinc(half / np.pi) * v])


def rotation_vector_to_matrix(v: np.ndarray) -> np.ndarray:
    """Return the matrix of the rotation by ``|v|`` rad about ``v``; one vector, shape (3, 3)."""
    return quaternion_to_matrix(rotation_vector_to_quaternion(v))


def axes_to_matrix(axes: Mapping[str, Sequence[float]] | Sequence[Sequence[float]]) -> np.ndarray:
    """Return the rotation matrix whose columns are the frame's axes in the parent.

    axes: two named axes (the first exact, the second made perpendicular), or all three. Raises ValueError as
    `check_axes` does.
    """
    check_axes(axes)
    if not isinstance(axes, Mapping):
        u, _, vt = np.linalg.svd(np.array(axes, dtype=float).T)
        return u @ vt
    (first, a), (second, b) = ((name, np.array(v, dtype=float)) for name, v in axes.items())
    a = a / np.linalg.norm(a)
    b = b - a * (a @ b)
    b = b / np.linalg.norm(b)
    R = np.empty((3, 3))
    i, j = "xyz".index(first), "xyz".index(second)
    k = 3 - i - j
    R[:, i], R[:, j] = a, b
    R[:, k] = np.cross(a, b) if (j - i) % 3 == 1 else np.cross(b, a)
    return R


def axis_to_matrix(axis: Sequence[float]) -> np.ndarray:
    """Return the matrix of the least rotation that turns z to a direction; for -z, half a turn about x.

    Raises ValueError as `check_axis` does.
    """
    check_axis(axis)
    a = np.array(axis, dtype=float)
    x, y, z = (a / np.linalg.norm(a)).tolist()
    square = x * x + y * y  # squared sine of the angle between axis and z
    # 1e-18: squared sine of the angle to -z below which a direction counts as -z
    if z < 0.0 and square < 1e-18:  # rounding would decide the axis of the half turn
        return axes_to_matrix({"z": [x, y, z], "x": [1.0, 0.0, 0.0]})
    fraction = 1.0 / (1.0 + z) if z >= 0.0 else (1.0 - z) / square
    return np.array(
        [[1.0 - fraction * x * x, -fraction * x * y, x], [-fraction * x * y, 1.0 - fraction * y * y, y], [-x, -y, z]]
    )


def rotation_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angle of the rotation that takes pose a to pose b [rad], shape (...,), in [0, pi].

    a, b: unit quaternions, shape (..., 4). Accurate for small angles, too: the angle is computed from the vector part,
    not from an arc cosine close to 1.
    """
    relative = quaternion_product(quaternion_conjugate(a), b)
    return 2.0 * np.arctan2(np.linalg.norm(relative[..., 1:], axis=-1), np.abs(relative[..., 0]))


def angle_about_y(quaternion: np.ndarray) -> np.ndarray:
    """Return the angle about the world's y axis, asin(R_WB[0, 2]) [rad], shape (...,), in [-pi/2, pi/2].

    quaternion: unit, w x y z, body to world, shape (..., 4). Positive by the right-hand rule; for a rotation about y
    alone this is the rotation's angle. It is the angle of tables 7-9.
    """
    R = quaternion_to_matrix(quaternion)
    return np.arcsin(np.clip(R[..., 0, 2], -1.0, 1.0))


@dataclass(frozen=True, slots=True)
class Turning:
    """Rotation of a body since the start: `angle` [rad], shape (time,), about `axis`, a unit vector.

    With full turns, positive by the right-hand rule about the axis (world axes, its largest component positive). Where
    the body has no fixed axis of rotation, `axis` is None and the angle is in [0, pi].
    """

    angle: np.ndarray
    axis: tuple[float, float, float] | None

    @property
    def title(self) -> str:
        """Name of the angle, for headings of figures."""
        if self.axis is None:
            return "rotation from the start"
        along = [name for name, part in zip("xyz", self.axis, strict=True) if part > 1.0 - OFF_AXIS]
        return f"rotation about {along[0] if along else 'its axis'}"


def rotation_since_start(time: np.ndarray, quaternion: np.ndarray, angular_velocity: np.ndarray) -> Turning:
    """Return a body's rotation since the start at each time [s]; quaternion: w x y z, shape (time, 4).

    angular_velocity: world axes [rad/s], shape (time, 3); it determines the number of full turns between two rows.
    """
    since = quaternion_product(quaternion, quaternion_conjugate(quaternion[:1]))
    _, sizes, axes = np.linalg.svd(since[:, 1:], full_matrices=False)
    if sizes[0] == 0.0 or sizes[1] > OFF_AXIS * sizes[0]:
        return Turning(rotation_between(quaternion[:1], quaternion), None)
    # of components equal up to rounding the first decides
    largest = np.abs(axes[0]) > (1.0 - OFF_AXIS) * np.abs(axes[0]).max()
    axis = axes[0] * np.sign(axes[0][np.argmax(largest)])
    angle = 2.0 * np.arctan2(since[:, 1:] @ axis, since[:, 0])
    rate = angular_velocity @ axis
    expected = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    counted = expected + np.unwrap(angle - expected)
    x, y, z = (float(part) for part in axis)
    return Turning(counted - 2.0 * np.pi * np.round(counted[0] / (2.0 * np.pi)), (x, y, z))


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Return the von Mises stress in the unit of the components, shape (...,) for (..., 6): xx yy zz yz xz xy."""
    x, y, z, yz, xz, xy = np.moveaxis(stress, -1, 0)
    normal = (x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2
    return np.asarray(np.sqrt(0.5 * normal + 3.0 * (yz**2 + xz**2 + xy**2)))


def principal(stress: np.ndarray) -> np.ndarray:
    """Return the principal stresses, the largest first, shape (..., 3) for (..., 6)."""
    return np.asarray(np.linalg.eigvalsh(matrices(stress))[..., ::-1])


def matrices(stress: np.ndarray) -> np.ndarray:
    """Return the symmetric matrices (..., 3, 3) of components (..., 6): xx yy zz yz xz xy."""
    x, y, z, yz, xz, xy = np.moveaxis(stress, -1, 0)
    return np.stack([np.stack(row, axis=-1) for row in ((x, xy, xz), (xy, y, yz), (xz, yz, z))], axis=-2)


def components(matrix: np.ndarray) -> np.ndarray:
    """Return the components (..., 6) of symmetric matrices (..., 3, 3)."""
    return np.asarray(matrix[..., [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]])
