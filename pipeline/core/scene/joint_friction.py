"""Friction of ideal joints that follows the force which they carry: laws of contacts, on a bearing of given size."""

from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, Union

from pydantic import Field, create_model

from flexclear.pipeline.core.scene.clearance import FRICTIONS
from flexclear.pipeline.core.scene.fields import Force, Length, Part, Positive

#: sizes that the bearing of a joint may have, and the one that it must have
SIZES: dict[str, tuple[set[str], set[str]]] = {
    "revolute": ({"radius", "length", "axial_radius"}, {"radius"}),
    "prismatic": ({"radius", "length"}, set()),
    "cylindrical": ({"radius", "length"}, {"radius"}),
    "universal": ({"radius", "length"}, {"radius"}),
    "spherical": ({"radius"}, {"radius"}),
}


class _Bearing(Part):
    """Where an ideal joint rubs; absent sizes mean that what they would turn into a pressure is not counted.

    radius: of the pin, the ball, or the pins of a universal joint's cross; of a prismatic joint the arm of the pads
    that hold moments about its axis.  length: between the two ends that carry moments across the axis; of a prismatic
    joint that of the slider, its middle at the second frame's origin.  axial_radius: of the collar that carries what a
    revolute joint is pushed along its axis; default: `radius`.  preload: normal force that is always there.
    """

    radius: Annotated[Length, Positive] | None = None
    length: Annotated[Length, Positive] | None = None
    axial_radius: Annotated[Length, Positive] | None = None
    preload: Annotated[Force, Field(ge=0.0)] = 0.0


def _rubbing(law: Any) -> Any:
    """The parameters of a friction law of contacts, and those of a bearing."""
    return create_model(f"{law.__name__}Bearing", __base__=(_Bearing, law), __doc__=law.__doc__, __module__=__name__)


if TYPE_CHECKING:
    JointFriction: TypeAlias = Any
else:
    JointFriction = Annotated[Union[tuple(_rubbing(law) for law in FRICTIONS)], Field(discriminator="law")]  # noqa: UP007


def require_fitting(kind: str, friction: Any) -> None:
    """ValueError for a joint type that does not rub, and for sizes that its bearing lacks or cannot have."""
    if kind not in SIZES:
        known = ", ".join(SIZES)
        raise ValueError(f"a joint of type '{kind}' has no friction of its own; those that have: {known}")
    possible, needed = SIZES[kind]
    given = {name for name in ("radius", "length", "axial_radius") if getattr(friction, name) is not None}
    for name in sorted(needed - given):
        raise ValueError(
            f"friction in a {kind} joint needs a {name}: its moment is the friction force times that; none is given"
        )
    for name in sorted(given - possible):
        may = ", ".join(sorted(possible))
        raise ValueError(f"the bearing of a {kind} joint has no {name}; sizes that it may have: {may}")
