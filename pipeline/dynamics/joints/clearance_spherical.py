"""Ball in a socket with clearance: the surfaces part along the line of centres, in space.

Nothing but the contact (`contact.forces`) joins the bodies.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import radial


@kernel
def separation(f, w, outer, numbers, p, v):
    """Gap [m], rate of penetration, normal towards the socket, its rate, and the offset that closes the gap.

    p, v: offset of the ball's centre from the socket's, its rate as seen from the socket, world axes.
    outer: frame of the socket.  numbers: of the contact.
    """
    distance, rate, normal, turning = radial(p, v)
    return f[numbers + m.CONTACT_NUMBERS.clearance] - distance, rate, normal, turning, p


class ClearanceSpherical:
    """See the module's text."""

    separation = staticmethod(separation)
