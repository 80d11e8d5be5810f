"""Ball above a plane, the xy plane of the outer frame; z points out of the ground towards the ball.

Source: Wang & Wang (2019), eq. (26), with a plane for the socket.
"""

from __future__ import annotations

import math
from typing import Any

from flexclear.dynamics.contact.hertz import plane_stiffness, published
from flexclear.dynamics.contact.surfaces.separation import Separation
from flexclear.dynamics.vectors import ZERO, Matrix, Vector, dot
from flexclear.scene.loose_joints import BallOnPlane


def separation(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation from the plane."""
    z = R_WA.column(2)
    height = dot(z, p)
    return Separation(height - numbers.radius, -dot(z, v), -z, ZERO, height * z)


stiffness = published({1.5: plane_stiffness})


def contact_size(joint: BallOnPlane, depth: float, force: float) -> float:
    """Return the radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
    return math.sqrt(joint.radius * depth)
