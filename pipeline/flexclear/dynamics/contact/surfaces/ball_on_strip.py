"""Ball above a strip of a plane: the face of a block that ends across x of the outer frame, in front and behind.

The strip contains x and y of its frame; z points towards the ball. Beyond an end the ball falls past the block's edge:
the gap is the distance from the block, positive or negative, which is continuous there.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.hertz import plane_stiffness, published
from flexclear.dynamics.contact.surfaces.ball_on_plane import contact_size
from flexclear.dynamics.contact.surfaces.separation import Separation
from flexclear.dynamics.specialise.symbols import branch, copysign, smaller, sqrt
from flexclear.dynamics.vectors import ZERO, Matrix, Vector, dot

__all__ = ["contact_size", "separation", "stiffness"]


def separation(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation from the strip and its ends; shape[0]: half the length of the strip [m]."""
    x, z = R_WA.column(0), R_WA.column(2)
    along, height = dot(x, p), dot(z, p)
    end = copysign(1.0, along) * x
    past = abs(along) - numbers.shape[0]

    def edge() -> tuple[Any, Vector, Vector]:
        distance = sqrt(past * past + height * height)
        n = (past / distance) * end + (height / distance) * z
        across = (past / distance) * z - (height / distance) * end
        return distance, n, (dot(across, v) / distance) * across

    def face() -> tuple[Any, Vector, Vector]:
        return branch(height >= past, lambda: (height, z, ZERO), lambda: (past, end, ZERO))

    away, n, turning = branch(smaller(past, height) > 0.0, edge, face)
    return Separation(away - numbers.radius, -dot(n, v), -n, -turning, away * n)


stiffness = published({1.5: plane_stiffness})
