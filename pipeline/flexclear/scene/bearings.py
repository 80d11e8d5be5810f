"""Bearings of ideal joints with friction: their sizes, with the parameters of a friction law."""

from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, Union

from pydantic import Field, create_model

from flexclear.scene.clearance import FRICTIONS
from flexclear.scene.fields import Force, Length, Part, Positive

#: sizes that the bearing of a joint may have, and those that it must have
SIZES: dict[str, tuple[set[str], set[str]]] = {
    "revolute": ({"radius", "length", "axial_radius"}, {"radius"}),
    "prismatic": ({"radius", "length"}, set()),
    "cylindrical": ({"radius", "length"}, {"radius"}),
    "universal": ({"radius", "length"}, {"radius"}),
    "spherical": ({"radius"}, {"radius"}),
}


class _Bearing(Part):
    """Surfaces of an ideal joint with friction; loads whose conversion needs an absent size are not counted."""

    radius: Annotated[Length, Positive] | None = None
    """radius of the pin, the ball, or the pins of a universal joint's cross; of a prismatic joint the lever arm of the
    pads that carry moments about its axis"""
    length: Annotated[Length, Positive] | None = None
    """distance between the two ends that carry moments across the axis; of a prismatic joint the length of the slider,
    its middle at the second frame's origin"""
    axial_radius: Annotated[Length, Positive] | None = None
    """radius of the collar that carries the axial force of a revolute joint; default: `radius`"""
    preload: Annotated[Force, Field(ge=0.0)] = 0.0
    """constant normal force, added to the others"""


def _bearing_model(law: Any) -> Any:
    """Return a model with the parameters of a friction law and those of a bearing."""
    return create_model(f"{law.__name__}Bearing", __base__=(_Bearing, law), __doc__=law.__doc__, __module__=__name__)


if TYPE_CHECKING:
    JointFriction: TypeAlias = Any
else:
    JointFriction = Annotated[Union[tuple(_bearing_model(law) for law in FRICTIONS)], Field(discriminator="law")]  # noqa: UP007


def require_fitting(kind: str, friction: Any) -> None:
    """Raise ValueError for a joint type without friction, and for sizes that its bearing lacks or cannot have."""
    if kind not in SIZES:
        known = ", ".join(SIZES)
        raise ValueError(f"a joint of type '{kind}' has no friction of its own; those that have: {known}")
    if "x1" in friction.kind.split(","):
        raise ValueError("friction of an ideal joint depends on the slip alone: its coefficient has no normal_force")
    possible, needed = SIZES[kind]
    given = {name for name in ("radius", "length", "axial_radius") if getattr(friction, name) is not None}
    for name in sorted(needed - given):
        raise ValueError(
            f"friction in a {kind} joint needs a {name}, the lever arm of the friction force; none is given"
        )
    for name in sorted(given - possible):
        may = ", ".join(sorted(possible))
        raise ValueError(f"the bearing of a {kind} joint has no {name}; sizes of such a joint: {may}")
