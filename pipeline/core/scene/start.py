"""How a run begins, where that is more than the bodies' poses and velocities."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from flexclear.pipeline.core.scene.fields import Number, OnCoordinate, Part, PartName, given

#: the keys of one joint coordinate
KEYS = ("position", "near", "velocity")
#: where a run may begin, other than where the scene puts its bodies
At = Literal["equilibrium", "ideal"]
Measure = float | str


class JointStart(Part):
    """Start of one joint coordinate; its unit, where text gives one, is that of the coordinate or of its rate."""

    position: Measure | None = None
    """where it starts, exactly"""
    near: Measure | None = None
    """of several ways to assemble the mechanism, the one in which it is closest to this; without the poses of bodies it
    is also where the assembly is searched for"""
    velocity: Measure | None = None
    """its rate"""

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not given(self, KEYS):
            raise ValueError(f"one of {', '.join(KEYS)} says how the coordinate starts; here none does")
        if self.position is not None and self.near is not None:
            raise ValueError("position says where the coordinate starts, near only about where; give one of them")
        return self


def _coordinates(value: Any) -> Any:
    """A joint with one coordinate need not name it; the empty name represents it."""
    if isinstance(value, Mapping) and (not value or set(value) & {*KEYS, "source"}):
        return {"": value}
    return value


class ModalStart(Part):
    """Deformation of a flexible body at the start, by its modes in the order of the bundle; those left out are zero."""

    coordinate: tuple[Number, ...] = ()
    """modal coordinates [m]"""
    velocity: tuple[Number, ...] | None = None
    """their rates [m/s]; without them, the bodies'"""


_ONE_OR_SEVERAL = BeforeValidator(_coordinates, json_schema_input_type=JointStart | dict[str, JointStart])
JointStarts = Annotated[dict[str, JointStart], _ONE_OR_SEVERAL]


class Branch(OnCoordinate):
    """One way out of a change point: on which this joint coordinate changes most in the direction of `sign`."""

    sign: Literal[1, -1]
    """1 takes the branch on which the coordinate grows most, or falls least; -1 that on which it falls most, or grows
    least"""


def _several(value: Any) -> Any:
    """One choice need not be written as a list."""
    return (value,) if isinstance(value, (Mapping, Branch)) else value


class Start(Part):
    """The start of the run."""

    at: At | None = None
    """"equilibrium", the static equilibrium with the drives where their laws start, and the joint coordinates whose
    `position` is given held there; or "ideal", where the mechanism without clearance would start, each loose pin
    resting in its socket on the side to which the joint's force presses it, flexible bodies deformed as the loads of
    that moment hold them"""
    joint: dict[PartName, JointStarts] = Field(default_factory=dict)
    """of joints, by name; those with several coordinates by the coordinate's name below"""
    modal: dict[PartName, ModalStart] = Field(default_factory=dict)
    """of flexible bodies, by name"""
    branch: Annotated[
        tuple[Branch, ...], BeforeValidator(_several, json_schema_input_type=Branch | tuple[Branch, ...])
    ] = ()
    """in a change point, which of the branches that cross there the motion takes; with several loops a list, each
    choosing among what those before it have left"""

    @model_validator(mode="after")
    def _no_two_deformations(self) -> Self:
        given = [name for name, modal in self.modal.items() if modal.coordinate]
        if self.at is not None and given:
            raise ValueError(
                f"at = '{self.at}' says how bodies are deformed, and so does modal.{given[0]}.coordinate: "
                "give one of them"
            )
        return self
