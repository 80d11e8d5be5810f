"""Ball in a socket with clearance: the surfaces part along the line of centres, in space.

Nothing but the contact (`contact.forces`) joins the bodies.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import radial


@kernel
def separation(axes, numbers, p, v):
    """Gap [m], rate of penetration, normal towards the socket, its rate, and the offset that closes the gap.

    p, v: offset of the ball's centre from the socket's, its rate as seen from the socket, world axes.
    axes: of the socket, world axes.  numbers: of the contact (CONTACT_NUMBERS).
    """
    distance, rate, normal, turning = radial(p, v)
    return numbers.clearance - distance, rate, normal, turning, p


class ClearanceSpherical:
    """See the module's text."""

    separation = staticmethod(separation)
