"""Ball in a socket with clearance: the surfaces separate along the line of centres, in space.

Only the contact (`contact.forces`) connects the bodies.
Source: Wang & Wang (2019), eq. (26).
"""

from __future__ import annotations

import math

from flexclear.dynamics.contact.hertz import published, relative_radius, sphere_stiffness
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import radial
from flexclear.scene.loose_joints import ClearanceSpherical


@kernel
def separation(axes, numbers, p, v):
    """Return gap [m], rate of penetration, normal towards the socket, its rate, and the offset that closes the gap.

    p, v: offset of the ball's centre from the socket's, and its rate as seen from the socket, world axes.
    axes: of the socket, world axes.  numbers: of the contact (CONTACT_NUMBERS).
    Source: Wang & Wang (2019), eqs. (19), (20), (21), (22).
    """
    distance, rate, normal, turning = radial(p, v)
    return numbers.clearance - distance, rate, normal, turning, p


stiffness = published({1.5: sphere_stiffness})


def contact_size(joint: ClearanceSpherical, depth: float, force: float) -> float:
    """Return the radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
    return math.sqrt(relative_radius(joint) * depth)
