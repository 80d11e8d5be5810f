"""Pin in a straight slot with clearance: two walls along x of the slot's frame, and a half circle at each end.

The pin's centre is led by the straight part of the slot's centre line; between its ends the gap is measured across it,
beyond them from the end. Axial motion and tilt are held as a planar joint holds them (`joints.HELD`).
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.dynamics.kernels import kernel
from flexclear.pipeline.dynamics.vectors import axis, dot, radial, scale, sub


@kernel
def separation(axes, numbers, p, v):
    """As `clearance_spherical.separation`; shape: half the length of the straight part [m]."""
    x, z, half = axis(axes, 0), axis(axes, 2), numbers.shape[0]
    across, across_rate = sub(p, scale(dot(z, p), z)), sub(v, scale(dot(z, v), z))
    along = dot(x, p)
    if abs(along) <= half:
        across, across_rate = sub(across, scale(along, x)), sub(across_rate, scale(dot(x, v), x))
    else:
        across = sub(across, scale(np.copysign(half, along), x))
    distance, rate, normal, turning = radial(across, across_rate)
    return numbers.clearance - distance, rate, normal, turning, across


class ClearanceSlot:
    """See the module's text."""

    separation = staticmethod(separation)
