"""Stops at the ends of joint coordinates, and gears between them."""

from typing import Self

from pydantic import model_validator

from flexclear.pipeline.core.scene.clearance import NormalLaw
from flexclear.pipeline.core.scene.fields import Part
from flexclear.pipeline.core.scene.laws import Value


class Stop(Part):
    """Contact where a joint coordinate reaches an end; the coordinate's zero and sign are those of the joint.

    lower, upper: the ends, one or both; angles continue beyond half a turn, from within half a turn of zero at the
    start.
    normal: a normal law of contacts with its stiffness, of angles in N m and rad.  floor: least approach speed used as
    impact rate; without it 1e-6 rad/s, or of lengths that of contacts.  initial_approach_speed: of an end that the
    scene's start has passed; without it, such a start is refused.
    joint: name of the joint.  coordinate: name of its coordinate, where it has several.
    """

    joint: str
    coordinate: str | None = None
    lower: Value | None = None
    upper: Value | None = None
    normal: NormalLaw
    floor: Value | None = None
    initial_approach_speed: Value | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.lower is None and self.upper is None:
            raise ValueError("a stop needs an end: give lower, upper or both; it has neither")
        if self.normal.stiffness is None:
            raise ValueError("the stiffness of a stop is unknown: give normal.stiffness")
        mass = (self.normal.restitution, self.normal.delivered_restitution) != (None, None)
        if self.normal.law == "kelvin-voigt" and mass and self.normal.effective_mass is None:
            raise ValueError(
                "the mass that meets a stop depends on the pose, so a linear stop needs a damping, "
                "or a restitution with the effective_mass [kg or kg m^2] that is to rebound with it"
            )
        return self

    @property
    def ends(self) -> tuple[str, ...]:
        """Which ends there are."""
        return tuple(end for end in ("lower", "upper") if getattr(self, end) is not None)


class Gear(Part):
    """A joint coordinate that follows another one: change of `second` = ratio times change of `first`.

    first, second: joints (``A``), with the coordinate where there are several (``A.rotation``).
    ratio: a number; of a slide that follows an angle a length per angle ("10 mm/rad"), and the other way round.
    """

    first: str
    second: str
    ratio: Value

    @model_validator(mode="after")
    def _two(self) -> Self:
        if self.first == self.second:
            raise ValueError(f"a gear couples two coordinates; first and second are both '{self.first}'")
        return self
