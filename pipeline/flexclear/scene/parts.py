"""The parts of a scene: bodies and their appearance, joints, stops and gears. Each effect is a part; an effect without
its part is absent."""

import math
import re
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, WithJsonSchema, model_validator

from flexclear.scene.bearings import JointFriction, require_fitting
from flexclear.scene.fields import (
    AngularVelocity,
    FrameName,
    Inertia,
    Length,
    Mass,
    Number,
    Part,
    PartName,
    Pose,
    Position,
    Positive,
    Time,
    Velocity,
    require_one,
)
from flexclear.scene.loose_joints import Clearance
from flexclear.scene.segments import FEWEST, MOST
from flexclear.scene.units import quantity

#: keys of a body that affect pictures only
UNSEEN = ("geometry", "color")


class BoxShape(Part):
    """A box about the origin of `pose`."""

    type: Literal["box"]
    size: Position
    """lengths of the edges along x, y and z"""
    pose: Pose = Pose()
    """pose of the box's centre in the body frame"""

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        if min(self.size) <= 0.0:
            raise ValueError(f"the edges of a box must be longer than zero, not {list(self.size)} m")
        return self


class CylinderShape(Part):
    """A cylinder about the origin of `pose`, its axis along z."""

    type: Literal["cylinder"]
    radius: Annotated[Length, Positive]
    """radius of the cylinder"""
    length: Annotated[Length, Positive]
    """length of the cylinder along z"""
    pose: Pose = Pose()
    """pose of the cylinder's centre in the body frame"""


class SphereShape(Part):
    """A sphere about the origin of `pose`."""

    type: Literal["sphere"]
    radius: Annotated[Length, Positive]
    """radius of the sphere"""
    pose: Pose = Pose()
    """pose of the sphere's centre in the body frame"""


class FileShape(Part):
    """A surface from a file that meshio reads: STL, VTK, PLY, OBJ; of volume meshes the boundary."""

    type: Literal["file"]
    file: str
    """the file, searched for next to the scene"""
    unit: Annotated[Length, Positive] = 1.0
    """length of one unit of the file, such as 1 mm"""
    pose: Pose = Pose()
    """pose of the file's axes in the body frame"""


Shape = Annotated[BoxShape | CylinderShape | SphereShape | FileShape, Field(discriminator="type")]


def _color(value: Any) -> Any:
    if isinstance(value, str) and not re.fullmatch("#[0-9a-fA-F]{6}", value):
        raise ValueError(f"a colour is written as '#0072B2' (red, green and blue, hexadecimal), not '{value}'")
    return value


Color = Annotated[str, BeforeValidator(_color)]


class Seen(Part):
    """Appearance of a body in pictures, instead of the one that follows from its joints."""

    geometry: tuple[Shape, ...] | None = None
    """shapes that pictures show, [] for none; default: bars and plates between the joints"""
    color: Color | None = None
    """colour of the body in pictures, such as #0072B2"""


class Ground(Seen):
    """The fixed world; listed only to give it frames."""

    type: Literal["ground"]
    frames: dict[PartName, Pose] = Field(default_factory=dict)
    """named frames fixed in the world"""


class Moving(Seen):
    """Keys of all bodies that move."""

    pose: Pose | None = None
    """start pose of the body frame; without it, it follows from a joint"""
    velocity: Velocity | None = None
    """start velocity of the centre of mass, world axes"""
    angular_velocity: AngularVelocity | None = None
    """start angular velocity of the body frame, world axes"""


#: error of the frame positions from a mesh, as a fraction of their distance: the centre of a hole is the mean of its
#: nodes; with sixteen around a hole of a twentieth of that distance, a chord is off the circle by 2 % of the radius
FRAME_ERROR = 1e-3


class RigidBody(Moving):
    """Mass, centre of mass and inertia about it, all in the body frame."""

    type: Literal["rigid"]
    mass: Annotated[Mass, Positive]
    """mass of the body"""
    com: Position = (0.0, 0.0, 0.0)
    """centre of mass in the body frame"""
    inertia: Inertia
    frames: dict[PartName, Pose] = Field(default_factory=dict)
    """named points with axes on the body, in the body frame"""
    frame_tolerance: Annotated[Length, Field(ge=0.0)] = 0.0
    """distance by which the body's frames may be moved so that the joints fit; for bodies from a mesh a thousandth of
    the distance of their frames"""


class MasslessBody(RigidBody):
    """A body that only carries frames, such as those of two joints in a row: ``mass = 0``, without inertia."""

    mass: Literal[0]
    """zero"""
    inertia: Inertia
    """zeros, [0, 0, 0]"""


def _hertz(value: Any) -> float:
    """Return a frequency [Hz] from a bare number, or text with a unit."""
    number = f"{value} Hz" if isinstance(value, (int, float)) and not isinstance(value, bool) else value
    return quantity(number, "angular velocity") / (2.0 * math.pi)


Frequency = Annotated[
    float, BeforeValidator(_hertz), WithJsonSchema({"type": ["number", "string"], "description": "frequency in Hz"})
]


class Modes(Part):
    """Elastic coordinates of a flexible body; their number is given by one of count, up_to, compliance and mass."""

    reference: str
    """name of the reference condition, as docs/structure.md lists them"""
    count: Annotated[int, Field(ge=0, le=1_000_000)] | Literal["all"] | None = None
    """number of elastic coordinates, static (constraint or attachment) modes included; "all" for a complete basis; 0
    makes a rigid body with the recipe's mass and inertia"""
    up_to: Annotated[Frequency, Positive] | None = None
    """highest frequency of the retained normal modes, such as 5000 Hz"""
    compliance: Annotated[Number, Field(gt=0.0, le=1.0)] | None = None
    """least fraction of the static compliance between the interfaces, in each of the six directions"""
    mass: Annotated[Number, Field(gt=0.0, le=1.0)] | None = None
    """least fraction of the body's mass that moves with the basis, in each direction"""
    interfaces: tuple[str, ...] | None = None
    """the recipe's frames that a basis is built for; default: the recipe's own list"""
    held: tuple[FrameName, ...] = ()
    """motions held by the reference "constrained", as "top.rz": frame and x, y, z, rx, ry or rz in its axes"""
    of: str | None = None
    """reference condition of the shapes on which "mean-axis" is based"""

    @model_validator(mode="after")
    def _one_choice(self) -> Self:
        require_one(self, ("count", "up_to", "compliance", "mass"), "says how many modes are retained")
        return self


class RatioPerMode(Part):
    """Damping ratio of each elastic coordinate, in the order of the bundle's modes."""

    ratios: tuple[Annotated[Number, Field(ge=0.0)], ...]
    """damping ratio of each mode, as a fraction of critical damping"""


class Rayleigh(Part):
    """Damping matrix alpha M + beta K of the deformation; rigid motion of the body is not damped.

    alpha [1/s], beta [s]: the ratio of a mode with frequency omega is (alpha/omega + beta omega)/2.
    """

    alpha: Annotated[Number, Field(ge=0.0)] = 0.0
    """coefficient of the mass matrix [1/s]"""
    beta: Annotated[Time, Field(ge=0.0)] = 0.0
    """coefficient of the stiffness matrix [s]"""


class Stiffening(Part):
    """Forces and accelerations stiffen the body, or soften it in compression: bending and twist shorten it."""


def _of_several(value: tuple[int, int]) -> tuple[int, int]:
    if not 1 <= value[0] <= value[1]:
        raise ValueError(f"a segment is [k, n], the k-th of n, not {list(value)}")
    return value


OneOfSeveral = Annotated[tuple[int, int], AfterValidator(_of_several)]


class FlexibleBody(Moving):
    """A body reduced from a mesh; its frames are those of the recipe, its body frame is that of the undeformed mesh."""

    type: Literal["flexible"]
    mesh: str
    """file of the mesh recipe, relative to the scene"""
    modes: Modes
    """elastic coordinates of the body"""
    damping: Annotated[Number, Field(gt=0.0)] | RatioPerMode | Rayleigh | None = None
    """one modal damping ratio of all elastic coordinates, a ratio per mode, or Rayleigh damping; default: none"""
    stiffening: Stiffening | None = None
    """``{}`` for a body that forces and accelerations stiffen or soften, as a blade or column; default: they do not"""
    segments: Annotated[int, Field(ge=FEWEST, le=MOST)] | None = None
    """number of segments into which a rod that bends far is cut, each with these modes; ``modes`` then names no
    interfaces. The segments of ``rod`` are the bodies ``rod_1``, ``rod_2`` ...; default: the rod is one body"""
    segment: OneOfSeveral | None = None
    """the rod's segment that this body is, [k, n] for the k-th of n, as `segments` writes it; default: the whole"""

    @model_validator(mode="after")
    def _ends_are_interfaces(self) -> Self:
        if (self.segments or self.segment) and (self.modes.interfaces or self.modes.held):
            raise ValueError("the ends of segments are their interfaces: leave out modes.interfaces and modes.held")
        return self


class MeshedRigidBody(Moving):
    """A rigid body with the mass, the inertia and the frames of a mesh recipe: a flexible body without its modes.

    ``modes = { count = 0 }`` of a flexible body means the same; damping and stiffening then have no effect.
    """

    type: Literal["rigid"]
    mesh: str
    """file of the mesh recipe, relative to the scene; the body frame is that of the mesh"""
    segment: OneOfSeveral | None = None
    """the rod's segment that this body is, as of a flexible body; default: the whole"""

    @model_validator(mode="before")
    @classmethod
    def _without_modes(cls, table: Any) -> Any:
        if not isinstance(table, dict) or table.get("type") != "flexible":
            return table
        rest = {key: value for key, value in table.items() if key not in ("modes", "damping", "stiffening", "segments")}
        if isinstance(rest.get("source"), dict):
            rest["source"] = {key: text for key, text in rest["source"].items() if key in rest}
        return {**rest, "type": "rigid"}


def _all_zero(inertia: Any) -> bool:
    """Return True for the inertia of nothing: three zeros, or three rows of them."""
    given = list(inertia) if isinstance(inertia, (list, tuple)) else [inertia]
    rows = [row if isinstance(row, (list, tuple)) else [row] for row in given]
    return all(entry in (0, 0.0) for row in rows for entry in row)


def _model_tag(body: Any) -> str | None:
    """Return the tag of a body's model: its type, but "meshed" for a body with a recipe and no modes."""
    if isinstance(body, MeshedRigidBody):
        return "meshed"
    if not isinstance(body, dict):
        return getattr(body, "type", None)
    modes = body.get("modes")
    if body.get("type") == "rigid" and body.get("mass") in (0, 0.0) and _all_zero(body.get("inertia")):
        return "massless"
    none = isinstance(modes, dict) and modes.get("count") == 0 and not isinstance(modes.get("count"), bool)
    if (body.get("type") == "rigid" and "mesh" in body) or (body.get("type") == "flexible" and none):
        return "meshed"
    return body.get("type")


Body = Annotated[
    Annotated[Ground, Tag("ground")]
    | Annotated[RigidBody, Tag("rigid")]
    | Annotated[FlexibleBody, Tag("flexible")]
    | Annotated[MeshedRigidBody, Tag("meshed")]
    | Annotated[MasslessBody, Tag("massless")],
    Discriminator(_model_tag),
]


class IdealJoint(Part):
    """Two frames; the axes of motion are those of the first, and the axis of the joint is z.

    A pin in a slot slides along x and turns about z. A free joint constrains nothing, so that a body flies. The motion
    of each type is in `dynamics.joints`.
    """

    type: Literal["spherical", "revolute", "universal", "prismatic", "cylindrical", "slot", "planar", "fixed", "free"]
    """relative motion that the joint leaves free"""
    between: tuple[FrameName, FrameName]
    """first frame, whose axes are those of motion, and second frame, each as body.FRAME"""
    friction: JointFriction | None = None
    """friction by the force that the joint carries; default: none"""

    @model_validator(mode="after")
    def _check_friction(self) -> Self:
        if self.friction is not None:
            require_fitting(self.type, self.friction)
        return self


#: types of ideal joints
IDEAL: tuple[str, ...] = get_args(IdealJoint.model_fields["type"].annotation)
Joint = Annotated[IdealJoint | Clearance, Field(discriminator="type")]
