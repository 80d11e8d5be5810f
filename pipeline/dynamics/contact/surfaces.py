"""Stiffness of surfaces from radii and materials, and how large their contact grows."""

from __future__ import annotations

import math
from collections.abc import Callable

from flexclear.pipeline.core.scene.clearance import BallOnPlane as OnPlane
from flexclear.pipeline.core.scene.clearance import Clearance, ClearanceRevolute, ClearanceSlot, ClearanceSpherical

#: joints whose surfaces meet along a line
Pin = ClearanceRevolute | ClearanceSlot


def compliance(joint: Clearance) -> float:
    r"""Sum of sigma = (1 - nu^2) / (pi E) [1/Pa] of both surfaces; 1 / (pi times it) is Hertz's E*."""
    return sum(
        (1.0 - material.poisson**2) / (math.pi * material.youngs_modulus)
        for material in joint.materials
        if material is not None
    )


def sphere_stiffness(joint: Clearance) -> float:
    r"""Generalised stiffness K [N/m^1.5] of a sphere in a sphere.

    .. math:: K = \frac{4}{3\pi(\sigma_i+\sigma_j)}\sqrt{\frac{R_iR_j}{R_i-R_j}}, \quad
              \sigma = \frac{1-\nu^2}{\pi E}

    It grows as the clearance to the power -1/2. Holds while the contact's radius is small against
    the ball's (below about 0.3 of it).
    Source: Wang & Wang (2019), eq. (26).
    """
    return 4.0 / (3.0 * math.pi * compliance(joint)) * math.sqrt(relative_radius(joint))


def plane_stiffness(joint: Clearance) -> float:
    r"""The same [N/m^1.5] of a sphere on a plane: :math:`K = \frac{4}{3\pi(\sigma_i+\sigma_j)}\sqrt{R}`."""
    return 4.0 / (3.0 * math.pi * compliance(joint)) * math.sqrt(joint.radius)


def relative_radius(joint: Clearance) -> float:
    """Radius R_i R_j / (R_i - R_j) [m] of the sphere or cylinder that meets a plane as these two meet."""
    return (joint.radius + joint.clearance) * joint.radius / joint.clearance


class BallInSocket:
    """Ball in a socket."""

    @staticmethod
    def stiffness(joint: ClearanceSpherical, exponent: float) -> float:
        """K [N/m^exponent], given or of two spheres; ValueError where nothing is published."""
        if joint.normal.stiffness is not None:
            return joint.normal.stiffness
        if exponent != 1.5:
            raise ValueError(
                f"radii and materials give the stiffness of the exponent 1.5, not of {exponent:g}; "
                f"give normal.stiffness [N/m^{exponent:g}]"
            )
        return sphere_stiffness(joint)

    @staticmethod
    def contact_size(joint: ClearanceSpherical, depth: float, force: float) -> float:
        """Radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
        return math.sqrt(relative_radius(joint) * depth)


def _of_pin(joint: Pin, exponent: float, of_spheres: Callable[[Pin], float]) -> float:
    """Stiffness of a pin: given, of parallel cylinders, or `of_spheres`; ValueError where nothing is published."""
    if joint.normal.stiffness is not None:
        return joint.normal.stiffness
    if exponent == 1.0:
        return joint.length / (4.0 * compliance(joint))
    if exponent == 1.5:
        return of_spheres(joint)
    raise ValueError(
        f"radii and materials give the stiffness of the exponents 1 and 1.5, not of {exponent:g}; "
        f"give normal.stiffness [N/m^{exponent:g}]"
    )


def _half_width(joint: Pin, radius: float, depth: float, force: float) -> float:
    """Half-width of a pin's contact [m]; radius: relative one of the surfaces [m]."""
    if None in joint.materials:
        return math.sqrt(radius * depth)
    return math.sqrt(4.0 * force * radius * compliance(joint) / joint.length)


class PinInJournal:
    r"""Pin in a journal of parallel axis.

    Exponent 1.5: K [N/m^1.5] of two spheres of these radii, as is usual for revolute joints with
    clearance (Flores et al. 2008, sec. 3.1, after Lankarani & Nikravesh); the length does not enter.
    Exponent 1: :math:`K = \tfrac{\pi}{4}E^*L` [N/m] of two parallel cylinders (Popov 2017, Contact
    Mechanics and Friction, sec. 5.3); the radii do not enter. Both hold while the contact's
    half-width is small against the pin's radius (below about 0.3 of it).
    """

    @staticmethod
    def stiffness(joint: ClearanceRevolute, exponent: float) -> float:
        """K [N/m^exponent], given or as above; ValueError where nothing is published."""
        return _of_pin(joint, exponent, sphere_stiffness)

    @staticmethod
    def contact_size(joint: ClearanceRevolute, depth: float, force: float) -> float:
        r"""Half-width of the contact [m] under a force [N]: :math:`\sqrt{4FR/(\pi E^*L)}` (Hertz).

        Without materials: sqrt(R d), the width that a parabolic gap would leave.
        """
        return _half_width(joint, relative_radius(joint), depth, force)


class PinInSlot:
    r"""Pin between the walls of a slot, which are planes; its round ends are given the stiffness of the walls.

    Exponent 1.5: K [N/m^1.5] of a sphere on a plane, as is usual for revolute joints (see `PinInJournal`).
    Exponent 1: :math:`K = \tfrac{\pi}{4}E^*L` [N/m] of a cylinder on a plane.
    """

    @staticmethod
    def stiffness(joint: ClearanceSlot, exponent: float) -> float:
        """K [N/m^exponent], given or as above; ValueError where nothing is published."""
        return _of_pin(joint, exponent, plane_stiffness)

    @staticmethod
    def contact_size(joint: ClearanceSlot, depth: float, force: float) -> float:
        r"""Half-width of the contact [m] under a force [N]: :math:`\sqrt{4FR/(\pi E^*L)}` (Hertz).

        Without materials: sqrt(R d), the width that a parabolic gap would leave.
        """
        return _half_width(joint, joint.radius, depth, force)


class BallOnPlane:
    """Ball on a plane."""

    @staticmethod
    def stiffness(joint: OnPlane, exponent: float) -> float:
        """K [N/m^exponent], given or of Hertz; ValueError where nothing is published."""
        if joint.normal.stiffness is not None:
            return joint.normal.stiffness
        if exponent != 1.5:
            raise ValueError(
                f"radius and materials give the stiffness of the exponent 1.5, not of {exponent:g}; "
                f"give normal.stiffness [N/m^{exponent:g}]"
            )
        return plane_stiffness(joint)

    @staticmethod
    def contact_size(joint: OnPlane, depth: float, force: float) -> float:
        """Radius of the contact [m] at a penetration [m]: sqrt(R d) (Hertz)."""
        return math.sqrt(joint.radius * depth)
