"""The uniform cylinder or box with a body's mass and inertia: of rods, plates and discs that is the body itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: two principal moments closer than this fraction are called equal: a cylinder, not a box; tables print four digits
ROUND = 0.01
#: thinnest drawn thickness as a fraction of the body's largest extent, so that plates are seen
THINNEST = 0.03


@dataclass(frozen=True, slots=True)
class Solid:
    """Equivalent solid about the centre of mass: `axes` columns are its directions in the body frame.

    round: half extents are (radius, radius, half length), else those of a box.
    """

    axes: np.ndarray
    half: np.ndarray  #: [m]
    round: bool


def equivalent(mass: float, inertia: np.ndarray) -> Solid:
    """The uniform cylinder or box of this mass [kg] and inertia about its centre of mass [kg m^2]."""
    moments, axes = np.linalg.eigh(inertia)
    low, middle, high = moments / mass
    if high - low <= ROUND * high:  # alike about every axis: a cube shows how it turns
        return Solid(_right(axes), _visible(np.full(3, np.sqrt(1.5 * low))), round=False)
    if middle - low <= ROUND * high:
        moments, axes = moments[[0, 1, 2]], axes
    elif high - middle <= ROUND * high:
        axes = axes[:, [1, 2, 0]]
    else:
        squares = 1.5 * np.array([middle + high - low, low + high - middle, low + middle - high])
        return Solid(_right(axes), _visible(np.sqrt(np.clip(squares, 0.0, None))), round=False)
    across, along = (0.5 * (low + middle), high) if middle - low <= ROUND * high else (0.5 * (middle + high), low)
    radius = np.sqrt(2.0 * along)
    half_length = np.sqrt(3.0 * max(across - 0.25 * radius**2, 0.0))
    return Solid(_right(axes), _visible(np.array([radius, radius, half_length])), round=True)


def _visible(half: np.ndarray) -> np.ndarray:
    return np.maximum(half, THINNEST * half.max())


def _right(axes: np.ndarray) -> np.ndarray:
    return axes if np.linalg.det(axes) > 0 else axes * np.array([-1.0, 1.0, 1.0])
