"""Pin in a straight slot with clearance: two walls along x of the slot's frame, and a half circle at each end.

The straight part of the slot's centre line guides the pin's centre. Between its ends the gap is measured across it,
beyond them from the end. Axial motion and tilt are constrained as by a planar joint (`held` in scene/loose_joints).

The walls are planes; the round ends have the same stiffness. Exponent 1.5: K of a sphere on a plane, as is usual for
revolute joints (see `clearance_revolute`). Exponent 1: a cylinder on a plane.
Source: Wang & Wang (2019), eq. (26), with a plane for the socket.
"""

from __future__ import annotations

import numpy as np

from flexclear.dynamics.contact.hertz import cylinder_stiffness, half_width, plane_stiffness, published
from flexclear.dynamics.kernels import kernel
from flexclear.dynamics.vectors import axis, dot, radial, scale, sub
from flexclear.scene.loose_joints import ClearanceSlot


@kernel
def separation(axes, numbers, p, v):
    """Return the same as `clearance_spherical.separation`; shape[0]: half the length of the straight part [m]."""
    x, z, half = axis(axes, 0), axis(axes, 2), numbers.shape[0]
    across, across_rate = sub(p, scale(dot(z, p), z)), sub(v, scale(dot(z, v), z))
    along = dot(x, p)
    if abs(along) <= half:
        across, across_rate = sub(across, scale(along, x)), sub(across_rate, scale(dot(x, v), x))
    else:
        across = sub(across, scale(np.copysign(half, along), x))
    distance, rate, normal, turning = radial(across, across_rate)
    return numbers.clearance - distance, rate, normal, turning, across


stiffness = published({1.0: cylinder_stiffness, 1.5: plane_stiffness})


def contact_size(joint: ClearanceSlot, depth: float, force: float) -> float:
    """Return the half-width of the contact [m] under a force [N]."""
    return half_width(joint, joint.radius, depth, force)
