"""Ball in a socket with clearance: the surfaces separate along the line of centres, in space.

Only the contact (`mechanics.contacts`) connects the bodies.
Source: Wang & Wang (2019), eq. (26).
"""

from __future__ import annotations

import math
from typing import Any

from flexclear.dynamics.contact.hertz import published, relative_radius, sphere_stiffness
from flexclear.dynamics.contact.surfaces.separation import Separation, nested
from flexclear.dynamics.vectors import Matrix, Vector
from flexclear.scene.loose_joints import ClearanceSpherical


def separation(numbers: Any, R_WA: Matrix, p: Vector, v: Vector) -> Separation:
    """Return the separation along the line of centres; Wang & Wang (2019), eqs. (19), (20), (21), (22)."""
    return nested(numbers.clearance, p, v)


stiffness = published({1.5: sphere_stiffness})


def contact_size(joint: ClearanceSpherical, depth: float, force: float) -> float:
    """Return the radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
    return math.sqrt(relative_radius(joint) * depth)
