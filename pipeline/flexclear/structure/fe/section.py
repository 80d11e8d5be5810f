"""Cross sections: section constants and shear coefficients for beam elements.

Functions take floats, or arrays of one shape for a section that changes along the rod.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import zeta

Value = float | np.ndarray

#: Gauss points of a beam cell, at which its sections are evaluated; exact to degree nine. Cubic times cubic deflections
#: on an area that tapers linearly in both directions have degree eight, as have second moments times quadratic slopes
_GAUSS = np.polynomial.legendre.leggauss(5)
#: points on [0, 1] and weights, shape (points,)
POINTS = 0.5 * (1.0 + _GAUSS[0])
WEIGHTS = 0.5 * _GAUSS[1]
#: relative difference below which second moments equal those of a type of section
SAME = 1e-6


@dataclass(frozen=True, slots=True)
class Section:
    """Section constants about the centroid, axes y and z of the rod.

    `torsion` is St. Venant's constant; it equals the polar moment for circles and tubes only.
    """

    area: Value  #: A [m^2]
    torsion: Value  #: J [m^4]
    second_y: Value  #: int z^2 dA [m^4]
    second_z: Value  #: int y^2 dA [m^4]
    product: Value = 0.0  #: int y z dA [m^4]

    @property
    def polar(self) -> Value:
        """Polar moment, int (y^2 + z^2) dA [m^4]."""
        return self.second_y + self.second_z


def circle(radius: Value) -> Section:
    """Return the constants of a full circle; radius [m]."""
    return tube(radius, 0.0)


def tube(radius: Value, inner_radius: Value) -> Section:
    """Return the constants of a circular tube; outer and inner radius [m]."""
    area = math.pi * (radius**2 - inner_radius**2)
    second = math.pi * (radius**4 - inner_radius**4) / 4.0
    return Section(area, 2.0 * second, second, second)


def rectangle(width: Value, height: Value) -> Section:
    """Return the constants of a full rectangle; width along y, height along z [m]."""
    area = width * height
    return Section(area, rectangle_torsion(width, height), area * height**2 / 12.0, area * width**2 / 12.0)


def square(side: Value) -> Section:
    """Return the constants of a full square; side [m]."""
    return rectangle(side, side)


def rectangle_torsion(width: Value, height: Value) -> Value:
    """Return St. Venant's constant J [m^4] of a rectangle.

    With b the longer side and a the shorter one,
    ``J = b a^3 [1/3 - 64 a/(pi^5 b) sum tanh(k pi b / 2a) / k^5]`` over odd k.
    Source: Timoshenko & Goodier, *Theory of Elasticity*, sec. 109.
    """
    long, short = np.maximum(width, height), np.minimum(width, height)
    slope = math.pi * long / (2.0 * short)
    # the sum of 1/k^5 over odd k, less the shortfall of tanh from one; 1 - tanh x = 2 / (exp(2x) + 1) decays fast: 2
    # exp(-k pi) is below rounding from k = 13 on, even for the square
    short_of_one = sum(2.0 / (np.exp(np.minimum(2.0 * k * slope, 700.0)) + 1.0) / k**5 for k in range(1, 15, 2))
    series = 31.0 / 32.0 * zeta(5) - short_of_one
    torsion = long * short**3 * (1.0 / 3.0 - 64.0 / math.pi**5 * short / long * series)
    return torsion if np.ndim(torsion) else float(torsion)


def shape(types: tuple[str, ...], given: Section) -> tuple[str, tuple[float, ...]]:
    """Return which of `types` a section with these constants has, and the lengths of that type; empty for none."""
    for name in types:
        lengths = SHAPES[name].lengths(given) if name in SHAPES else ()
        if lengths and (len(types) == 1 or _has_moments_of(SHAPES[name].constants(*lengths), given)):
            return name, lengths
    return "", ()


def _has_moments_of(section: Section, given: Section) -> bool:
    a, b = (np.array([s.torsion, s.second_y, s.second_z], dtype=float) for s in (section, given))
    return bool(np.all(np.abs(a - b) <= SAME * b))


def _tube_lengths(given: Section) -> tuple[float, ...]:
    # A = pi (R^2 - r^2) and I = A (R^2 + r^2) / 4
    total, difference = float(4.0 * given.second_y / given.area), float(given.area / math.pi)
    if difference >= total:
        return ()
    return math.sqrt(0.5 * (total + difference)), math.sqrt(0.5 * (total - difference))


def _rectangle_lengths(given: Section) -> tuple[float, ...]:
    ratio = math.sqrt(given.second_z / given.second_y)
    return math.sqrt(given.area * ratio), math.sqrt(given.area / ratio)


@dataclass(frozen=True, slots=True)
class Shape:
    """A type of section. constants: from its lengths.  lengths: from constants; empty where none fit."""

    constants: Callable[..., Section]
    lengths: Callable[[Section], tuple[float, ...]]


#: types of section by the recipe's name; the general section is not in the table
SHAPES = {
    "circle": Shape(circle, lambda given: (math.sqrt(given.area / math.pi),)),
    "tube": Shape(tube, _tube_lengths),
    "rectangle": Shape(rectangle, _rectangle_lengths),
}


def tube_shear_coefficient(poisson: float, ratio: Value) -> Value:
    """Return the shear coefficient of a tube; `ratio` m: inner over outer radius, 0 for a full circle.

    ``6 (1 + nu) (1 + m^2)^2 / [(7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2]``.
    Source: Cowper (1966), J. Appl. Mech. 33, 335-340.
    """
    square_of_sum = (1.0 + ratio**2) ** 2
    whole = (7.0 + 6.0 * poisson) * square_of_sum + (20.0 + 12.0 * poisson) * ratio**2
    return 6.0 * (1.0 + poisson) * square_of_sum / whole


def rectangle_shear_coefficient(poisson: float) -> float:
    """Return the shear coefficient of a rectangle, ``10 (1 + nu) / (12 + 11 nu)``, equal along both sides.

    Source: Cowper (1966), J. Appl. Mech. 33, 335-340.
    """
    return 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
