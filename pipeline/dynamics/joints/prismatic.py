"""Sliding joint along z of the first frame."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import TRANSLATION, rates_are_speeds
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import IDENTITY, ZERO


@kernel
def motion(w, x, u, S):
    """Motion of frame G in frame F: x metres along z (see `spherical.motion`); Wang & Wang (2019), eqs. (30), (31)."""
    for k in range(6):
        w[S + k] = 0.0
    w[S + 5] = 1.0
    return IDENTITY, (0.0, 0.0, w[x]), ZERO, ZERO


position_rate = rates_are_speeds(1)


class Prismatic:
    """One displacement is free."""

    POSITIONS, SPEEDS = "t", "t"  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1)
    ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 0))
    COORDINATES = (TRANSLATION,)

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Displacement along z [m], shape (1,)."""
        return np.array([p[2]])
