"""Ball in a straight tube along z of the tube's frame: the gap is measured across the axis, along it nothing holds.

Exponent 1.5: K of two spheres, as for `clearance_revolute`, since the tube's curvature along its axis is left out.
Source: Wang & Wang (2019), eq. (26), of spheres.
"""

from __future__ import annotations

import math

from flexclear.dynamics.contact.hertz import published, relative_radius, sphere_stiffness
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import axis, dot, radial, scale, sub
from flexclear.scene.loose_joints import BallInTube


@kernel
def separation(axes, numbers, p, v):
    """Return the same as `clearance_spherical.separation`, for the components of p and v across the tube's axis."""
    z = axis(axes, 2)
    across = sub(p, scale(dot(z, p), z))
    distance, rate, normal, turning = radial(across, sub(v, scale(dot(z, v), z)))
    return numbers.clearance - distance, rate, normal, turning, across


stiffness = published({1.5: sphere_stiffness})


def contact_size(joint: BallInTube, depth: float, force: float) -> float:
    """Return the radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
    return math.sqrt(relative_radius(joint) * depth)
