"""Cross sections: the numbers that a beam element needs of them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Section:
    """Section constants about the centroid, in principal axes y and z of the mesh frame.

    `torsion` is St. Venant's constant, not the polar moment; the two agree for a circle only.
    """

    area: float  #: A [m^2]
    torsion: float  #: J [m^4]
    second_y: float  #: int z^2 dA [m^4]
    second_z: float  #: int y^2 dA [m^4]

    @property
    def polar(self) -> float:
        """Polar moment, int (y^2 + z^2) dA [m^4]."""
        return self.second_y + self.second_z


def circle(radius: float) -> Section:
    """Full circle; radius [m]."""
    area, second = math.pi * radius**2, math.pi * radius**4 / 4.0
    return Section(area, 2.0 * second, second, second)


def square(side: float) -> Section:
    """Full square; side [m].  St. Venant constant: Timoshenko & Goodier, *Theory of Elasticity*, sec. 109."""
    # J/side^4 = 1/3 - (64/pi^5) sum tanh(k pi/2)/k^5 over odd k; terms fall as k^-5, 60 of them reach 1e-11
    series = math.fsum(math.tanh(k * math.pi / 2.0) / k**5 for k in range(1, 121, 2))
    torsion = (1.0 / 3.0 - 64.0 / math.pi**5 * series) * side**4
    second = side**4 / 12.0
    return Section(side**2, torsion, second, second)


def circle_shear_coefficient(poisson: float) -> float:
    """Cowper's kappa of a full circle, ``6 (1 + nu) / (7 + 6 nu)``; Cowper (1966), J. Appl. Mech. 33."""
    return 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson)
