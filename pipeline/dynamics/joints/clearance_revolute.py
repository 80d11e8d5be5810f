"""Pin in a journal with clearance: a circle in a circle, in the plane normal to the journal's axis.

The axial motion and the tilt are held as a planar joint holds them (`joints.HELD`), by a force along the
axis and moments across it at the pin's frame. The contact (`contact.forces`) acts in the middle of
the bearing, where the two frames are; over-long bearings, which tilting pins touch at both rims, are
not modelled.
"""

from __future__ import annotations

from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import axis, dot, radial, scale, sub


@kernel
def separation(axes, numbers, p, v):
    """As `clearance_spherical.separation`, of the parts of p and v normal to the journal's axis."""
    z = axis(axes, 2)
    distance, rate, normal, turning = radial(sub(p, scale(dot(z, p), z)), sub(v, scale(dot(z, v), z)))
    return numbers.clearance - distance, rate, normal, turning, p


class ClearanceRevolute:
    """See the module's text."""

    separation = staticmethod(separation)
