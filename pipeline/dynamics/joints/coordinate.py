"""The single motions that a joint leaves free, as drives, loads and records name them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.dynamics.kernels import kernel


@dataclass(frozen=True)
class Coordinate:
    """One freedom of a joint between the frames F and G.

    axis: 0, 1, 2 for x, y, z of F (side 0) or of G (side 1), along or about which it moves.
    sine, cosine: entries of R_FG that are the sine and cosine of an angle.
    """

    name: str
    turning: bool
    axis: int = 2
    side: int = 0
    sine: tuple[int, int] = (1, 0)
    cosine: tuple[int, int] = (0, 0)

    @property
    def dimension(self) -> str:
        """Of its values, as scenes write them."""
        return "angle" if self.turning else "length"

    @property
    def unit(self) -> str:
        """Of its values in results."""
        return "rad" if self.turning else "m"

    @property
    def force(self) -> str:
        """Dimension of what acts along it."""
        return "torque" if self.turning else "force"

    @property
    def part(self) -> str:
        """Joint type with this freedom alone, about or along its z axis."""
        return "revolute" if self.turning else "prismatic"

    def along(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Its axis, shape (..., 3), at the frames F and G: named fields of SITE_FRAMES, shape (...)."""
        axis: np.ndarray = (b if self.side else a)["axes"][..., :, self.axis]
        return axis

    def wrench(self, a: np.ndarray, b: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Moment about the kernels' origin and force of what acts along it on G with a size, shapes (..., 3)."""
        push = size[..., None] * self.along(a, b)
        return (push, np.zeros_like(push)) if self.turning else (np.cross(b["origin"], push), push)

    @property
    def axes(self) -> np.ndarray:
        """Axes of a frame whose z is this freedom's axis, as columns in F, shape (3, 3)."""
        return np.roll(np.eye(3), self.axis + 1, axis=0)


ROTATION = Coordinate("rotation", True)
TRANSLATION = Coordinate("translation", False)


def angle_about_z(R: np.ndarray) -> float:
    """Angle [rad] in (-pi, pi] of the turn about z that R is, or is nearest to."""
    return float(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))


def rates_are_speeds(count: int) -> Callable:
    """The kernel `position_rate` of a joint with as many speeds, each of which is the rate of a position."""

    @kernel
    def position_rate(w, x, u, rate):
        for k in range(count):
            w[rate + k] = w[u + k]

    return position_rate
