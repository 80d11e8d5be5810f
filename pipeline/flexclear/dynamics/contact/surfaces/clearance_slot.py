"""Pin in a straight slot with clearance: two walls along x of the slot's frame, and a half circle at each end.

The straight part of the slot's centre line guides the pin's centre. Between its ends the gap is measured across it,
beyond them from the end. Axial motion and tilt are constrained as by a planar joint (`held` in scene/loose_joints).

The walls are planes; the round ends have the same stiffness. Exponent 1.5: K of a sphere on a plane, as is usual for
revolute joints (see `clearance_revolute`). Exponent 1: a cylinder on a plane.
Source: Wang & Wang (2019), eq. (26), with a plane for the socket.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact.hertz import cylinder_stiffness, half_width, plane_stiffness, published
from flexclear.dynamics.contact.surfaces.separation import Separation, across, nested
from flexclear.dynamics.specialise.symbols import copysign, select
from flexclear.dynamics.vectors import Matrix, Vector, dot
from flexclear.scene.loose_joints import ClearanceSlot


def separation(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation from the walls and ends; shape[0]: half the length of the straight part [m]."""
    x, z, half = R_WA.column(0), R_WA.column(2), numbers.shape[0]
    along = dot(x, p)
    between = abs(along) <= half
    guided = select(between, along, copysign(half, along)) * x  # the centre line's nearest point
    moving = select(between, dot(x, v), 0.0) * x
    return nested(numbers.clearance, across(z, p) - guided, across(z, v) - moving)


stiffness = published({1.0: cylinder_stiffness, 1.5: plane_stiffness})


def contact_size(joint: ClearanceSlot, depth: float, force: float) -> float:
    """Return the half-width of the contact [m] under a force [N]."""
    return half_width(joint, joint.radius, depth, force)
