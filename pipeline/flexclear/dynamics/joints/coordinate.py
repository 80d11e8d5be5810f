"""Joint coordinates: the single free motions of a joint, as drives, loads and records name them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexclear.dynamics.joints.conditions import Gauge, frame_motion, measure


@dataclass(frozen=True)
class Coordinate:
    """One freedom of a joint between the frames F and G.

    axis: 0, 1, 2 for x, y, z of F (side 0) or of G (side 1), along or about which the coordinate moves.
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
        """Dimension of the coordinate's values in scenes."""
        return "angle" if self.turning else "length"

    @property
    def unit(self) -> str:
        """Unit of the coordinate's values in results."""
        return "rad" if self.turning else "m"

    @property
    def force(self) -> str:
        """Dimension of a force along the coordinate."""
        return "torque" if self.turning else "force"

    @property
    def part(self) -> str:
        """Joint type with this freedom alone, about or along its z axis."""
        return "revolute" if self.turning else "prismatic"

    @property
    def gauge(self) -> Gauge:
        """The measurement of the coordinate between frames."""
        return Gauge(int(self.turning), self.side, self.axis, *self.sine, *self.cosine)

    def value(self, F: Any, G: Any) -> float:
        """Return the coordinate [rad in (-pi, pi], or m] at placements of the frames."""
        return float(measure(self.gauge, F.pose, G.pose)[0])

    def wrench(self, a: np.ndarray, b: np.ndarray, size: np.ndarray) -> list[np.ndarray]:
        """Return moment about the mechanism's origin and force on G, for a force `size` along the coordinate.

        a, b: frames F and G in named fields (`memory.FRAME`), shape (time,); each result has the shape (time, 3).
        """
        F, G = frame_motion(a), frame_motion(b)
        wrench = measure(self.gauge, F, G)[1] * size
        return [np.stack(part, axis=-1) for part in wrench.about(G.p_WB)]

    @property
    def axes(self) -> np.ndarray:
        """Axes of a frame whose z is this coordinate's axis, as columns in F, shape (3, 3)."""
        return np.roll(np.eye(3), self.axis + 1, axis=0)


ROTATION, ROTATION_Y = Coordinate("rotation", True), Coordinate("rotation", True, axis=1, sine=(0, 2))
TRANSLATION = Coordinate("translation", False)
