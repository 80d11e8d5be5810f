"""Hertzian contact: stiffness of surfaces from radii and materials, and contact widths."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from flexclear.scene.loose_joints import Clearance, Pin


def published(stiffness: Mapping[float, Callable[[Any], float]]) -> Callable[[Clearance, float], float]:
    """Return (joint, exponent) -> stiffness K [N/m^exponent], given by the scene or published for the exponent.

    The function raises ValueError for exponents without a published stiffness.
    """

    def given_or_published(joint: Clearance, exponent: float) -> float:
        if joint.normal.stiffness is not None:
            return joint.normal.stiffness
        if exponent in stiffness:
            return stiffness[exponent](joint)
        known = f"exponent{'s' if len(stiffness) > 1 else ''} {' and '.join(f'{one:g}' for one in stiffness)}"
        raise ValueError(
            f"radii and materials determine the stiffness for {known}, not for {exponent:g}; "
            f"give normal.stiffness [N/m^{exponent:g}]"
        )

    return given_or_published


def compliance(joint: Clearance | Pin) -> float:
    """Return the sum of sigma = (1 - nu^2) / (pi E) [1/Pa] over both surfaces; 1 / (pi sum) is Hertz's E*."""
    return sum(
        (1.0 - material.poisson**2) / (math.pi * material.youngs_modulus)
        for material in joint.materials
        if material is not None
    )


def sphere_stiffness(joint: Clearance) -> float:
    r"""Return the generalised stiffness K [N/m^1.5] of a sphere in a sphere.

    .. math:: K = \frac{4}{3\pi(\sigma_i+\sigma_j)}\sqrt{\frac{R_iR_j}{R_i-R_j}}, \quad
              \sigma = \frac{1-\nu^2}{\pi E}

    K grows as the clearance to the power -1/2. It holds while the contact's radius is small against
    the ball's (below about 0.3 of it).
    Source: Wang & Wang (2019), eq. (26).
    """
    return 4.0 / (3.0 * math.pi * compliance(joint)) * math.sqrt(relative_radius(joint))


def plane_stiffness(joint: Clearance) -> float:
    r"""Return K [N/m^1.5] of a sphere on a plane, :math:`K = \frac{4}{3\pi(\sigma_i+\sigma_j)}\sqrt{R}`."""
    return 4.0 / (3.0 * math.pi * compliance(joint)) * math.sqrt(joint.radius)


def cylinder_stiffness(joint: Pin) -> float:
    r"""Return K [N/m] of parallel cylinders, or of one on a plane: :math:`K = \tfrac{\pi}{4}E^*L`, for any radii."""
    return joint.length / (4.0 * compliance(joint))


def relative_radius(joint: Clearance) -> float:
    """Return the radius R_i R_j / (R_i - R_j) [m] of the sphere or cylinder on a plane with the same contact."""
    return (joint.radius + joint.clearance) * joint.radius / joint.clearance


def half_width(joint: Pin, radius: float, depth: float, force: float) -> float:
    r"""Return the half-width of a pin's contact [m] under a force [N]: :math:`\sqrt{4FR/(\pi E^*L)}` (Hertz).

    Without materials: sqrt(R d), the half-width for a parabolic gap.  radius: relative radius R of the surfaces [m].
    """
    if None in joint.materials:
        return math.sqrt(radius * depth)
    return math.sqrt(4.0 * force * radius * compliance(joint) / joint.length)
