"""Cross sections of a recipe: their schema, and the section constants that follow."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from flexclear.scene.fields import Area, Length, Number, Part, Positive, SecondMoment
from flexclear.structure.fe import section as sections
from flexclear.structure.fe.section import Section, Value


def _pair(value: Any) -> Any:
    """Return two numbers, along y and along z; one number counts for both."""
    return value if isinstance(value, (list, tuple)) else (value, value)


def _fractions(value: tuple[float, float]) -> tuple[float, float]:
    if not all(0.0 < kappa <= 1.0 for kappa in value):
        raise ValueError(f"a shear coefficient is a fraction of the area, above 0 and at most 1, not {list(value)}")
    return value


ShearCoefficient = Annotated[
    tuple[Number, Number],
    BeforeValidator(_pair, json_schema_input_type=Number | tuple[Number, Number]),
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
    return sections.SHAPES[start.type].constants(*_dimensions(start, end, s))


def inertia(start: Any, end: Any | None, given: Any | None, s: Value) -> tuple[Value, Value, Value, Value]:
    """Return the second moments of the mass: polar, about y, about z, product [m^4].

    given: the inertia section where it differs from that of the stiffness. It does not taper, but the square
    of equal area does, with the area.
    """
    if given is not None and given.type == "equal-area-square":
        values = sections.square(constants(start, end, s).area ** 0.5)
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
        kappa: Value = sections.rectangle_shear_coefficient(poisson)
    else:
        outer, *inner = _dimensions(start, end, s)
        kappa = sections.tube_shear_coefficient(poisson, inner[0] / outer if inner else 0.0)
    return kappa, kappa


def _dimensions(start: Any, end: Any | None, s: Value) -> list[Value]:
    names = DIMENSIONS[start.type]
    if end is None:
        return [getattr(start, name) for name in names]
    return [getattr(start, name) * (1.0 - np.asarray(s)) + getattr(end, name) * np.asarray(s) for name in names]
