"""What bodies look like in pictures: shapes and a colour. No effect on the motion, and in no key of it."""

import re
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from flexclear.pipeline.core.scene.fields import Length, Part, Pose, Position, Positive

#: keys of a body that only pictures see
UNSEEN = ("geometry", "color")


class BoxShape(Part):
    """A box about the origin of `pose`."""

    type: Literal["box"]
    size: Position = Field(description="lengths of the edges along x, y and z")
    pose: Pose = Field(default=Pose(), description="of the box's middle in the body frame")

    @model_validator(mode="after")
    def _extended(self) -> Self:
        if min(self.size) <= 0.0:
            raise ValueError(f"the edges of a box are longer than zero, not {list(self.size)} m")
        return self


class CylinderShape(Part):
    """A cylinder about the origin of `pose`, its axis along z."""

    type: Literal["cylinder"]
    radius: Annotated[Length, Positive] = Field(description="of the cylinder")
    length: Annotated[Length, Positive] = Field(description="along z")
    pose: Pose = Field(default=Pose(), description="of the cylinder's middle in the body frame")


class SphereShape(Part):
    """A sphere about the origin of `pose`."""

    type: Literal["sphere"]
    radius: Annotated[Length, Positive] = Field(description="of the sphere")
    pose: Pose = Field(default=Pose(), description="of the sphere's middle in the body frame")


class FileShape(Part):
    """A surface from a file that meshio reads: STL, VTK, PLY, OBJ; of volume meshes their boundary."""

    type: Literal["file"]
    file: str = Field(description="the file, searched for next to the scene")
    unit: Annotated[Length, Positive] = Field(default=1.0, description='length of one unit of the file, as "1 mm"')
    pose: Pose = Field(default=Pose(), description="of the file's axes in the body frame")


Shape = Annotated[BoxShape | CylinderShape | SphereShape | FileShape, Field(discriminator="type")]


def _color(value: Any) -> Any:
    if isinstance(value, str) and not re.fullmatch("#[0-9a-fA-F]{6}", value):
        raise ValueError(f"a colour is written as '#0072B2' (red, green and blue, hexadecimal), not '{value}'")
    return value


Color = Annotated[str, BeforeValidator(_color)]


class Seen(Part):
    """What pictures show of a body instead of what follows from its joints."""

    geometry: tuple[Shape, ...] | None = Field(
        default=None,
        description="shapes that pictures show, [] for none; default: bars and plates between the joints",
    )
    color: Color | None = Field(default=None, description='in pictures, as "#0072B2"')
