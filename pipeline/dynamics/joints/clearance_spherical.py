"""Ball in a socket with clearance: the surfaces part along the line of centres, in space.

Nothing but the contact (`contact.forces`) joins the bodies.
"""

from __future__ import annotations

from pipeline.dynamics.kernels import kernel


@kernel
def separation(w, outer, p):
    """Offset of the inner surface's centre that closes the gap, from that between the centres [m]."""
    return p


class ClearanceSpherical:
    """See the module's text."""

    separation = staticmethod(separation)
