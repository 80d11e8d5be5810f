"""Drives, which prescribe a motion: either a coordinate of a joint, or the pose of a frame in the world."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from flexclear.scene.fields import FrameName, OnCoordinate, Part, given_keys
from flexclear.scene.laws import Bare


class JointDrive(OnCoordinate):
    """Prescribes one coordinate of a joint; needs its name if the joint has several."""

    law: Bare
    """position as a law of time"""


class Components(Part):
    """Laws along, or about, the axes; a component without a law stays free."""

    x: Bare | None = None
    """law of this component"""
    y: Bare | None = None
    """law of this component"""
    z: Bare | None = None
    """law of this component"""

    def laws(self) -> dict[str, Any]:
        """Return the given laws, by axis."""
        return {axis: getattr(self, axis) for axis in given_keys(self, ("x", "y", "z"))}


class PathDrive(Part):
    """Prescribes the pose of a frame in the world, or some components of it."""

    frame: FrameName
    position: Components | None = None
    """position of the frame's origin [m]"""
    rotation: Components | None = None
    """rotation from the world's axes to the frame's, by `angles`: 'cardan' rotates about x, then about the rotated y,
    then about the rotated z; 'rotation-vector' takes all three components"""
    angles: Literal["cardan", "rotation-vector"] = "cardan"
    """meaning of the components of rotation: Cardan angles or a rotation vector"""
    actuators: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """joints (``P1``, or ``C.rotation`` where a joint has several coordinates) whose forces produce this motion;
    without them the drive itself acts on the frame"""
    allocation: Literal["unique", "least-norm"] = "unique"
    """with more actuators than degrees of freedom: refuse, or choose the forces with the least sum of squares (in N and
    N m)"""

    @model_validator(mode="after")
    def _check_components(self) -> Self:
        if not list(self.components()):
            raise ValueError("a path must prescribe at least one component of position or rotation")
        turning = self.rotation.laws() if self.rotation is not None else {}
        if self.angles == "rotation-vector" and 0 < len(turning) < 3:
            raise ValueError("a rotation vector needs all three components: give rotation.x, rotation.y and rotation.z")
        if self.actuators is not None and len(set(self.actuators)) < len(self.actuators):
            twice = next(name for name in self.actuators if self.actuators.count(name) > 1)
            raise ValueError(f"each actuator must be named once; '{twice}' is named twice")
        return self

    def components(self) -> Iterator[tuple[str, Any]]:
        """Yield the prescribed components, as ``position.x``, and their laws."""
        for kind in ("position", "rotation"):
            part = getattr(self, kind)
            for axis, law in (part.laws() if part is not None else {}).items():
                yield f"{kind}.{axis}", law


def _drive_tag(data: Any) -> str:
    frame = "frame" in data if isinstance(data, dict) else isinstance(data, PathDrive)
    return "path-drive" if frame else "joint-drive"


Drive = Annotated[
    Annotated[JointDrive, Tag("joint-drive")] | Annotated[PathDrive, Tag("path-drive")], Discriminator(_drive_tag)
]
