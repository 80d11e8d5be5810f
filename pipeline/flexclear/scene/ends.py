"""Stops and gears: ends of joint coordinates, and coordinates that follow another one, rigidly or by their flanks."""

from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from flexclear.scene.clearance import KelvinVoigt, NormalLaw
from flexclear.scene.fields import Number, OnCoordinate, Part, Positive, given_keys, require_one
from flexclear.scene.laws import Value


class Stop(OnCoordinate):
    """Contact where a joint coordinate reaches an end; the coordinate's zero and sign are those of the joint."""

    family: ClassVar[str] = "stop"

    lower: Value | None = None
    """ends of the coordinate, one or both; angles count full turns, from within half a turn of zero at the start"""
    upper: Value | None = None
    """ends of the coordinate, one or both; angles count full turns, from within half a turn of zero at the start"""
    relative_to: str | None = None
    """another joint (``A``), with the coordinate if it has several (``A.rotation``), whose `ratio`-fold is subtracted:
    the ends are those of the difference; default: nothing is subtracted"""
    ratio: Value | None = None
    """factor of the coordinate that is subtracted, as of a gear; default: 1"""
    normal: NormalLaw
    """normal law of contacts with its stiffness, for angles in N m and rad"""
    floor: Value | None = None
    """least approach speed used as impact rate; default: 1e-6 rad/s, or for lengths as in contacts"""
    initial_approach_speed: Value | None = None
    """impact rate of an end that the coordinate has passed at the start, 0 for a resting one; without this key such a
    start is refused, unless it is an equilibrium"""

    @model_validator(mode="after")
    def _require_an_end(self) -> Self:
        if self.lower is None and self.upper is None:
            raise ValueError("a stop needs an end: give lower, upper or both; it has neither")
        if self.ratio is not None and self.relative_to is None:
            raise ValueError("ratio is the factor of the coordinate relative_to; give both, or no ratio")
        _require_law_of_ends("stop", self.normal)
        return self

    @property
    def end_law(self) -> Any:
        """Normal law of the ends."""
        return self.normal

    @property
    def ends(self) -> tuple[str, ...]:
        """Names of the given ends."""
        return tuple(given_keys(self, ("lower", "upper")))


def _require_law_of_ends(what: str, law: Any) -> None:
    """Raise ValueError for a normal law that follows from radii, materials or masses, which ends lack."""
    if form := getattr(law, "form", None):
        raise ValueError(f"a {what} has no radii, which the form '{form}' needs; give normal.stiffness")
    if law.needs_materials:
        raise ValueError(f"the stiffness of a {what} is unknown: give normal.stiffness")
    if law.needs_mass:
        raise ValueError(
            f"the mass that meets a {what} depends on the pose, so a linear {what} needs a damping, "
            "or a restitution with the effective_mass [kg or kg m^2] for that restitution"
        )


#: keys of a gear that are of teeth with a backlash
OF_TEETH = ("backlash", "stiffness", "damping", "normal", "centre", "floor", "initial_approach_speed")


class Gear(Part):
    """A joint coordinate that follows another one: change of `second` = ratio times change of `first`.

    Teeth with a backlash touch on either flank, as a stop does: ``lower`` where `second` falls behind, ``upper`` where
    it is ahead.
    """

    family: ClassVar[str] = "gear"

    first: str
    """joint (``A``), with the coordinate if the joint has several (``A.rotation``)"""
    second: str
    """joint (``A``), with the coordinate if the joint has several (``A.rotation``)"""
    ratio: Value
    """a number; between a translation and a rotation a length per angle ("10 mm/rad") or an angle per length"""
    backlash: Value | None = None
    """play of `second` from flank to flank while `first` rests; default: none, as the teeth are rigid"""
    stiffness: Annotated[Number, Positive] | None = None
    """stiffness of the teeth along `second` [N m/rad or N/m], of a linear law, instead of `normal`"""
    damping: Annotated[Number, Field(ge=0.0)] | None = None
    """damping of the teeth with this stiffness [N m s/rad or N s/m]; default: none"""
    normal: NormalLaw | None = None
    """normal law of the flanks, as of a stop, instead of `stiffness`"""
    centre: Value | None = None
    """`second` less ratio times `first` in the middle of the backlash; default: its value at the start"""
    floor: Value | None = None
    """least approach speed of the flanks used as impact rate, as of a stop"""
    initial_approach_speed: Value | None = None
    """impact rate of a flank that touches at the start, as of a stop"""

    @model_validator(mode="after")
    def _check_coordinates(self) -> Self:
        if self.first == self.second:
            raise ValueError(f"a gear couples two coordinates; first and second are both '{self.first}'")
        of_teeth = given_keys(self, OF_TEETH[1:])
        if self.backlash is None and of_teeth:
            raise ValueError(f"{of_teeth[0]} is of teeth with a backlash; give backlash, or leave it out")
        if self.backlash is not None:
            require_one(self, ("stiffness", "normal"), "says how stiff the teeth are")
            if self.normal is not None and self.damping is not None:
                raise ValueError("damping belongs to stiffness; with a normal law the damping is that of the law")
            _require_law_of_ends("flank", self.end_law)
        return self

    @property
    def end_law(self) -> Any:
        """Normal law of the flanks."""
        given = {"law": "kelvin-voigt", "stiffness": self.stiffness, "damping": self.damping or 0.0}
        return self.normal or KelvinVoigt.model_validate(given)

    @property
    def ends(self) -> tuple[str, ...]:
        """Names of the flanks."""
        return ("lower", "upper")

    @property
    def joint(self) -> str:
        """Name of the joint of the second coordinate."""
        return self.second.partition(".")[0]

    @property
    def coordinate(self) -> str | None:
        """Name of the second coordinate, if it is given."""
        return self.second.partition(".")[2] or None
