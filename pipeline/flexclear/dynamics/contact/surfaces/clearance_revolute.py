"""Pin in a journal with clearance: a circle in a circle, in the plane normal to the journal's axis.

Axial motion and tilt are constrained as by a planar joint (`held` in scene/loose_joints), with a force along the
axis and moments across it at the pin's frame. The contact (`mechanics.contacts`) acts in the middle of
the bearing, where the two frames are; over-long bearings, which tilting pins touch at both rims, are
not modelled.

Exponent 1.5: K [N/m^1.5] of two spheres of these radii, as is usual for revolute joints with
clearance (Flores et al. 2008, sec. 3.1, after Lankarani & Nikravesh); the length does not enter.
Exponent 1: two parallel cylinders; the radii do not enter. Both hold while the contact's
half-width is small against the pin's radius (below about 0.3 of it).
Source: Wang & Wang (2019), eq. (26), of spheres; Popov (2017), Contact Mechanics and Friction, sec. 5.3, of
cylinders.
"""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.contact import hertz
from flexclear.dynamics.contact.surfaces.separation import Separation, across, nested
from flexclear.dynamics.vectors import Matrix, Vector
from flexclear.scene.loose_joints import ClearanceRevolute


def separation(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation in the plane across the journal's axis z."""
    z = R_WA.column(2)
    return nested(numbers.clearance, across(z, p), across(z, v))._replace(offset=p)


stiffness = hertz.published({1.0: hertz.cylinder_stiffness, 1.5: hertz.sphere_stiffness})


def contact_size(joint: ClearanceRevolute, depth: float, force: float) -> float:
    """Return the half-width of the contact [m] under a force [N]."""
    return hertz.half_width(joint, hertz.relative_radius(joint), depth, force)
