"""Ball in a straight tube along z of the tube's frame: the gap is measured across the axis, along it nothing holds.

Exponent 1.5: K of two spheres, as for `clearance_revolute`, since the tube's curvature along its axis is left out.
Source: Wang & Wang (2019), eq. (26), of spheres.
"""

from __future__ import annotations

import math
from typing import Any

from flexclear.dynamics.contact.hertz import published, relative_radius, sphere_stiffness
from flexclear.dynamics.contact.surfaces.separation import Separation, across, nested
from flexclear.dynamics.vectors import Matrix, Vector
from flexclear.scene.loose_joints import BallInTube


def separation(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation across the tube's axis z."""
    z = R_WA.column(2)
    return nested(numbers.clearance, across(z, p), across(z, v))


stiffness = published({1.5: sphere_stiffness})


def contact_size(joint: BallInTube, depth: float, force: float) -> float:
    """Return the radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
    return math.sqrt(relative_radius(joint) * depth)
