"""Ball above a plane, the xy plane of the outer frame; z points out of the ground towards the ball.

Source: Wang & Wang (2019), eq. (26), with a plane for the socket.
"""

from __future__ import annotations

import math

from flexclear.dynamics.contact.hertz import plane_stiffness, published
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import ZERO, axis, dot, scale
from flexclear.scene.loose_joints import BallOnPlane


@kernel
def separation(axes, numbers, p, v):
    """Return the same as `clearance_spherical.separation`; the normal points into the plane."""
    z = axis(axes, 2)
    height = dot(z, p)
    return height - numbers.radius, -dot(z, v), scale(-1.0, z), ZERO, scale(height, z)


stiffness = published({1.5: plane_stiffness})


def contact_size(joint: BallOnPlane, depth: float, force: float) -> float:
    """Return the radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
    return math.sqrt(joint.radius * depth)
