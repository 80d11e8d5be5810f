"""Cross sections: section constants and shear coefficients for beam elements, and their schema in recipes.

Functions take floats, or arrays of one shape for a section that changes along the rod.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from scipy.special import zeta

from flexclear.scene.fields import Area, Length, Number, Part, Positive, SecondMoment

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


def _two_numbers(value: Any) -> Any:
    """Return two numbers, along y and along z; one number counts for both."""
    return value if isinstance(value, (list, tuple)) else (value, value)


def _fractions(value: tuple[float, float]) -> tuple[float, float]:
    if not all(0.0 < kappa <= 1.0 for kappa in value):
        raise ValueError(f"a shear coefficient is a fraction of the area, above 0 and at most 1, not {list(value)}")
    return value


ShearCoefficient = Annotated[
    tuple[Number, Number],
    BeforeValidator(_two_numbers, json_schema_input_type=Number | tuple[Number, Number]),
    AfterValidator(_fractions),
]


class CircleSection(Part):
    """Full circle."""

    type: Literal["circle"]
    radius: Annotated[Length, Positive]
    """radius of the circle"""
    shear_coefficient: ShearCoefficient | None = None
    """shear coefficient kappa, instead of Cowper's (1966)"""


class TubeSection(Part):
    """Circular tube; `inner_radius` is that of the hole."""

    type: Literal["tube"]
    radius: Annotated[Length, Positive]
    """radius of the outer circle and of the hole"""
    inner_radius: Annotated[Length, Positive]
    """radius of the outer circle and of the hole"""
    shear_coefficient: ShearCoefficient | None = None
    """shear coefficient kappa, instead of Cowper's (1966)"""

    @model_validator(mode="after")
    def _has_a_wall(self) -> TubeSection:
        if not self.inner_radius < self.radius:
            raise ValueError(f"the hole's radius {self.inner_radius:g} m is not below the radius {self.radius:g} m")
        return self


class RectangleSection(Part):
    """Full rectangle, `width` along y and `height` along z of the rod."""

    type: Literal["rectangle"]
    width: Annotated[Length, Positive]
    """side along y and along z of the rod"""
    height: Annotated[Length, Positive]
    """side along y and along z of the rod"""
    shear_coefficient: ShearCoefficient | None = None
    """kappa instead of Cowper's (1966)"""


class GeneralSection(Part):
    """Any section, given by its constants about the centroid, which is also its shear centre."""

    type: Literal["general"]
    area: Annotated[Area, Positive]
    """area of the section"""
    torsion: Annotated[SecondMoment, Positive]
    """St. Venant's torsion constant J"""
    second_y: Annotated[SecondMoment, Positive]
    """int z^2 dA"""
    second_z: Annotated[SecondMoment, Positive]
    """int y^2 dA"""
    product: SecondMoment = 0.0
    """int y z dA"""
    inertia: tuple[Annotated[SecondMoment, Positive], SecondMoment, SecondMoment] | None = None
    """second moments of the mass about x (polar), y and z, where they differ from those of the area"""
    shear_coefficient: ShearCoefficient | None = None
    """shear coefficient kappa, one number or [along y, along z]; needed by Timoshenko beams only"""

    @model_validator(mode="after")
    def _moments_are_of_an_area(self) -> GeneralSection:
        if not self.product**2 < self.second_y * self.second_z:
            raise ValueError(
                f"product = {self.product:g} m^4: its square is below second_y second_z = "
                f"{self.second_y * self.second_z:g} m^8 for every area"
            )
        if self.inertia is not None and min(self.inertia) < 0.0:
            raise ValueError(f"inertia = {list(self.inertia)} m^4: second moments of a mass cannot be negative")
        return self


class EqualAreaSquare(Part):
    """The square with the area of the stiffness section; gives second moments to the mass only."""

    type: Literal["equal-area-square"]


AnySection = CircleSection | TubeSection | RectangleSection | GeneralSection
StiffnessSection = Annotated[AnySection, Field(discriminator="type")]
InertiaSection = Annotated[AnySection | EqualAreaSquare, Field(discriminator="type")]

#: lengths of a section that a linear taper changes
DIMENSIONS: dict[str, tuple[str, ...]] = {
    "circle": ("radius",),
    "tube": ("radius", "inner_radius"),
    "rectangle": ("width", "height"),
}


def constants(start: Any, end: Any | None, s: Value) -> Section:
    """Return the section constants at the fraction s of a span from section `start` to `end` (None: no taper)."""
    if start.type == "general":
        return Section(start.area, start.torsion, start.second_y, start.second_z, start.product)
    return SHAPES[start.type].constants(*_dimensions(start, end, s))


def inertia(start: Any, end: Any | None, given: Any | None, s: Value) -> tuple[Value, Value, Value, Value]:
    """Return the second moments of the mass: polar, about y, about z, product [m^4].

    given: the inertia section where it differs from that of the stiffness. It does not taper, but the square
    of equal area does, with the area.
    """
    if given is not None and given.type == "equal-area-square":
        values = square(constants(start, end, s).area ** 0.5)
    elif given is not None:
        return inertia(given, None, None, s)
    else:
        values = constants(start, end, s)
    if start.type == "general" and start.inertia is not None and given is None:
        # given separately, about the axes of the section
        return (*start.inertia, 0.0)
    return values.polar, values.second_y, values.second_z, values.product


def shear_coefficient(start: Any, end: Any | None, s: Value, poisson: float) -> tuple[Value, Value] | None:
    """Return kappa along y and z; None where the recipe of a general section gives none."""
    if start.shear_coefficient is not None or start.type == "general":
        return start.shear_coefficient
    if start.type == "rectangle":
        kappa: Value = rectangle_shear_coefficient(poisson)
    else:
        outer, *inner = _dimensions(start, end, s)
        kappa = tube_shear_coefficient(poisson, inner[0] / outer if inner else 0.0)
    return kappa, kappa


def _dimensions(start: Any, end: Any | None, s: Value) -> list[Value]:
    names = DIMENSIONS[start.type]
    if end is None:
        return [getattr(start, name) for name in names]
    return [getattr(start, name) * (1.0 - np.asarray(s)) + getattr(end, name) * np.asarray(s) for name in names]
