"""Rigid connection; met in the tree only where one of the two bodies is flexible."""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.joints.coordinate import Coordinate
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import IDENTITY, ZERO


@kernel
def motion(w, x, u, S):
    """The two frames coincide (see `spherical.motion`)."""
    return IDENTITY, ZERO, ZERO, ZERO


@kernel
def position_rate(w, x, u, rate):
    """There are no positions."""


class Fixed:
    """Nothing is free."""

    POSITIONS, SPEEDS = "", ""  #: r: rotation [rad or -], t: translation [m]
    TRANSLATIONS: tuple[int, ...] = (0, 1, 2)
    ROTATIONS: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 0))
    COORDINATES: tuple[Coordinate, ...] = ()

    @staticmethod
    def coordinates(R: np.ndarray, p: np.ndarray) -> np.ndarray:
        """No coordinates, shape (0,)."""
        return np.zeros(0)
