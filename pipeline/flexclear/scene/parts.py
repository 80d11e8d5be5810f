"""The parts of a scene: bodies and their appearance, joints, stops and gears. Each effect is a part; an effect without
its part is absent."""

import math
import re
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, WithJsonSchema, model_validator

from flexclear.scene.bearings import JointFriction, require_fitting
from flexclear.scene.clearance import KelvinVoigt, NormalLaw
from flexclear.scene.fields import (
    AngularVelocity,
    FrameName,
    Inertia,
    Length,
    Mass,
    Number,
    OnCoordinate,
    Part,
    PartName,
    Pose,
    Position,
    Positive,
    Time,
    Velocity,
    given_keys,
    require_one,
)
from flexclear.scene.laws import Value
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


def _which(body: Any) -> str | None:
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
    Discriminator(_which),
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
    def _complete(self) -> Self:
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
