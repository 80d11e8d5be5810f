"""Ball above a plane, which is that of x and y of the outer frame; z points out of the ground towards the ball."""

from __future__ import annotations

from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import ZERO, axis, dot, scale


@kernel
def separation(axes, numbers, p, v):
    """As `clearance_spherical.separation`; the normal points into the plane."""
    z = axis(axes, 2)
    height = dot(z, p)
    return height - numbers.radius, -dot(z, v), scale(-1.0, z), ZERO, scale(height, z)


class BallOnPlane:
    """See the module's text."""

    separation = staticmethod(separation)
