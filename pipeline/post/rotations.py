"""Angles that are read off quaternions; all functions broadcast over leading dimensions."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.core.algebra import quaternion_to_matrix


def angle_about_y(quaternion: np.ndarray) -> np.ndarray:
    """Angle about the world's y axis, asin(R_WB[0, 2]) [rad], shape (...,), in [-pi/2, pi/2].

    quaternion: unit, w x y z, body to world, shape (..., 4).  Positive by the right-hand rule; for a
    rotation about y alone it is that rotation.  This is the angle of tables 7-9.
    """
    R = quaternion_to_matrix(quaternion)
    return np.arcsin(np.clip(R[..., 0, 2], -1.0, 1.0))
