"""Angles that are read off quaternions; all functions broadcast over leading dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.core.numerics.rotations import (
    quaternion_conjugate,
    quaternion_product,
    quaternion_to_matrix,
    rotation_between,
)

#: fraction of a rotation that may be about other axes where it is called one about a fixed axis
OFF_AXIS = 1e-3


def angle_about_y(quaternion: np.ndarray) -> np.ndarray:
    """Angle about the world's y axis, asin(R_WB[0, 2]) [rad], shape (...,), in [-pi/2, pi/2].

    quaternion: unit, w x y z, body to world, shape (..., 4).  Positive by the right-hand rule; for a
    rotation about y alone it is that rotation.  This is the angle of tables 7-9.
    """
    R = quaternion_to_matrix(quaternion)
    return np.arcsin(np.clip(R[..., 0, 2], -1.0, 1.0))


@dataclass(frozen=True, slots=True)
class Turning:
    """How far a body has turned since the start: `angle` [rad], shape (time,), about `axis`, a unit vector.

    With full turns, positive by the right-hand rule about the axis (world axes, its largest component positive).
    Where the body does not turn about a fixed axis, `axis` is None and the angle that of the rotation, in [0, pi].
    """

    angle: np.ndarray
    axis: tuple[float, float, float] | None

    @property
    def title(self) -> str:
        """What the angle is, for headings of figures."""
        if self.axis is None:
            return "rotation from the start"
        along = [name for name, part in zip("xyz", self.axis, strict=True) if part > 1.0 - OFF_AXIS]
        return f"rotation about {along[0] if along else 'its axis'}"


def turning(time: np.ndarray, quaternion: np.ndarray, angular_velocity: np.ndarray) -> Turning:
    """How far a body has turned at each time [s]; quaternion: w x y z, shape (time, 4), of a body that may be flexible.

    angular_velocity: world axes [rad/s], shape (time, 3); it determines how many full turns lie between two rows.
    """
    since = quaternion_product(quaternion, quaternion_conjugate(quaternion[:1]))
    _, sizes, axes = np.linalg.svd(since[:, 1:], full_matrices=False)
    if sizes[0] == 0.0 or sizes[1] > OFF_AXIS * sizes[0]:
        return Turning(rotation_between(quaternion[:1], quaternion), None)
    # of components of one size the first decides, whatever rounding made of them
    largest = np.abs(axes[0]) > (1.0 - OFF_AXIS) * np.abs(axes[0]).max()
    axis = axes[0] * np.sign(axes[0][np.argmax(largest)])
    angle = 2.0 * np.arctan2(since[:, 1:] @ axis, since[:, 0])
    rate = angular_velocity @ axis
    expected = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    counted = expected + np.unwrap(angle - expected)
    x, y, z = (float(part) for part in axis)
    return Turning(counted - 2.0 * np.pi * np.round(counted[0] / (2.0 * np.pi)), (x, y, z))
