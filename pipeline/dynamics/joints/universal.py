"""Cardan joint: turning about x of the first frame, then about y of the frame so turned."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics import memory as m
from pipeline.dynamics.joints.coordinate import Coordinate
from pipeline.dynamics.kernels import kernel
from pipeline.dynamics.vectors import add, cross, put, put9, scale


@kernel
def motion(w, x, u, du, joint, rate):
    """Motion of frame G in frame F: R_FG = R_x(x0) R_y(x1) (see `spherical.motion`)."""
    for k in range(m.JOINT.columns):
        w[joint + k] = 0.0
    ca, sa, cb, sb = np.cos(w[x]), np.sin(w[x]), np.cos(w[x + 1]), np.sin(w[x + 1])
    put9(w, joint, (cb, 0.0, sb, sa * sb, ca, -sa * cb, -ca * sb, sa, ca * cb))
    first, second = (1.0, 0.0, 0.0), (0.0, ca, sa)
    turning = scale(w[u], first)
    put(w, joint + m.JOINT.omega, add(turning, scale(w[u + 1], second)))
    own = add(scale(w[du], first), scale(w[du + 1], second))
    put(w, joint + m.JOINT.alpha, add(own, scale(w[u + 1], cross(turning, second))))
    zero = (0.0, 0.0, 0.0)
    put(w, joint + m.JOINT.columns, first)
    put(w, joint + m.JOINT.columns + 3, zero)
    put(w, joint + m.JOINT.columns + 6, second)
    put(w, joint + m.JOINT.columns + 9, zero)
    w[rate], w[rate + 1] = w[u], w[u + 1]


class Universal:
    """Two rotations about crossing axes at right angles: x of the first frame and y of the second."""

    POSITIONS, SPEEDS = "rr", "rr"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
    ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1),)
    COORDINATES = (
        Coordinate("first", True, axis=0, sine=(2, 1), cosine=(1, 1)),
        Coordinate("second", True, axis=1, side=1, sine=(0, 2), cosine=(0, 0)),
    )
    motion = staticmethod(motion)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Angles about x of the first and y of the second frame [rad] in (-pi, pi], shape (2,)."""
        return np.array([np.arctan2(R[2, 1], R[1, 1]), np.arctan2(R[0, 2], R[0, 0])])
