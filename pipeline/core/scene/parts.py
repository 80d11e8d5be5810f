"""The parts of a scene: bodies and joints. An effect is a part; absent means not there."""

import math
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, WithJsonSchema, model_validator

from flexclear.pipeline.core.scene.appearance import Seen
from flexclear.pipeline.core.scene.clearance import BallOnPlane, ClearanceRevolute, ClearanceSlot, ClearanceSpherical
from flexclear.pipeline.core.scene.fields import (
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
)
from flexclear.pipeline.core.scene.joint_friction import JointFriction, require_fitting
from flexclear.pipeline.core.scene.units import quantity


class Ground(Seen):
    """The fixed world; listed only to give it frames.

    frames: named frames fixed in the world.
    """

    type: Literal["ground"]
    frames: dict[PartName, Pose] = Field(default_factory=dict)


class RigidBody(Seen):
    """Mass, centre of mass and inertia about it, all in the body frame.

    mass: mass of the body.  com: centre of mass in the body frame.  frames: named points with axes on the body, in the
    body frame.  frame_tolerance: how far its frames may be moved so that the joints fit, where they nearly do; of
    bodies from a mesh a thousandth of the distance of their frames, as the nodes of a hole know its middle no better.
    """

    type: Literal["rigid"]
    mass: Annotated[Mass, Positive]
    com: Position = (0.0, 0.0, 0.0)
    inertia: Inertia
    pose: Pose | None = Field(
        default=None, description="start pose of the body frame; without it, it follows from a joint"
    )
    velocity: Velocity | None = Field(default=None, description="start velocity of the centre of mass, world axes")
    angular_velocity: AngularVelocity | None = Field(default=None, description="start angular velocity, world axes")
    frames: dict[PartName, Pose] = Field(default_factory=dict)
    frame_tolerance: Annotated[Length, Field(ge=0.0)] = 0.0


def _hertz(value: Any) -> float:
    """A frequency [Hz]: a bare number, or text with a unit."""
    number = f"{value} Hz" if isinstance(value, (int, float)) and not isinstance(value, bool) else value
    return quantity(number, "angular velocity") / (2.0 * math.pi)


Frequency = Annotated[
    float, BeforeValidator(_hertz), WithJsonSchema({"type": ["number", "string"], "description": "frequency in Hz"})
]


class Modes(Part):
    """Which elastic coordinates a flexible body keeps: one of count, up_to, compliance and mass says how many.

    count: number of elastic coordinates, static (constraint or attachment) modes included; "all" for a complete
    basis; 0 makes a rigid body with the recipe's mass and inertia.
    up_to: highest frequency of the retained normal modes, e.g. "5000 Hz".
    compliance: least fraction of the static compliance between the interfaces, in each of the six directions.
    mass: least fraction of the body's mass that moves with the basis, in each direction.
    interfaces: the recipe's frames that a basis is built for; default: the recipe's own list.
    held: motions held by the reference "constrained", as "top.rz": frame and x, y, z, rx, ry or rz in its axes.
    of: the reference whose shapes "mean-axis" is based on.
    reference: name of the reference condition, as docs/structure.md lists them.
    """

    reference: str
    count: Annotated[int, Field(ge=0)] | Literal["all"] | None = None
    up_to: Annotated[Frequency, Positive] | None = None
    compliance: Annotated[Number, Field(gt=0.0, le=1.0)] | None = None
    mass: Annotated[Number, Field(gt=0.0, le=1.0)] | None = None
    interfaces: tuple[str, ...] | None = None
    held: tuple[FrameName, ...] = ()
    of: str | None = None

    @model_validator(mode="after")
    def _one_choice(self) -> Self:
        ways = ("count", "up_to", "compliance", "mass")
        given = [name for name in ways if getattr(self, name) is not None]
        if len(given) != 1:
            shown = "nothing does" if not given else f"{' and '.join(given)} do"
            raise ValueError(f"one of {', '.join(ways)} says how many modes are retained; here {shown}")
        return self


class RatioPerMode(Part):
    """Damping ratio of each elastic coordinate, in the order of the bundle's modes.

    ratios: of each mode, of critical damping.
    """

    ratios: tuple[Annotated[Number, Field(ge=0.0)], ...]


class Rayleigh(Part):
    """Damping matrix alpha M + beta K of the deformation; rigid motion of the body is not damped.

    alpha [1/s], beta [s]: the ratio of a mode with frequency omega is (alpha/omega + beta omega)/2.

    alpha: of the mass [1/s].  beta: of the stiffness [s].
    """

    alpha: Annotated[Number, Field(ge=0.0)] = 0.0
    beta: Annotated[Time, Field(ge=0.0)] = 0.0


class Stiffening(Part):
    """Bending shortens a beam: centrifugal and axial loads then stiffen it (or soften, in compression)."""


class FlexibleBody(Seen):
    """A body reduced from a mesh; its frames are those of the recipe.

    pose: start pose of the undeformed mesh frame.
    damping: one modal damping ratio of all elastic coordinates, a ratio per mode, or Rayleigh's; absent means none.
    stiffening: ``{}`` for a beam that turns fast or carries large axial loads; absent means linear shapes.
    mesh: file of the mesh recipe, relative to the scene.  modes: which elastic coordinates are retained.  velocity:
    start
    velocity of the centre of mass, world axes.  angular_velocity: start angular velocity of the body frame, world axes.
    """

    type: Literal["flexible"]
    mesh: str
    modes: Modes
    damping: Annotated[Number, Field(gt=0.0)] | RatioPerMode | Rayleigh | None = None
    stiffening: Stiffening | None = None
    pose: Pose | None = None
    velocity: Velocity | None = None
    angular_velocity: AngularVelocity | None = None


class MeshedRigidBody(Seen):
    """A rigid body with the mass, the inertia and the frames of a mesh recipe: a flexible body without its modes.

    ``modes = { count = 0 }`` of a flexible body says the same; damping and stiffening then have nothing to act on.

    mesh: file of the mesh recipe, relative to the scene.  pose: start pose of the mesh frame; without it, it follows
    from a joint.  velocity: start velocity of the centre of mass, world axes.  angular_velocity: start angular
    velocity, world axes.
    """

    type: Literal["rigid"]
    mesh: str
    pose: Pose | None = None
    velocity: Velocity | None = None
    angular_velocity: AngularVelocity | None = None

    @model_validator(mode="before")
    @classmethod
    def _without_modes(cls, table: Any) -> Any:
        if not isinstance(table, dict) or table.get("type") != "flexible":
            return table
        rest = {key: value for key, value in table.items() if key not in ("modes", "damping", "stiffening")}
        if isinstance(rest.get("source"), dict):
            rest["source"] = {key: text for key, text in rest["source"].items() if key in rest}
        return {**rest, "type": "rigid"}


def _which(body: Any) -> str | None:
    """Which model a body is of: its type, but of a body with a recipe and no modes that of such bodies."""
    if isinstance(body, MeshedRigidBody):
        return "meshed"
    if not isinstance(body, dict):
        return getattr(body, "type", None)
    modes = body.get("modes")
    none = isinstance(modes, dict) and modes.get("count") == 0 and not isinstance(modes.get("count"), bool)
    if (body.get("type") == "rigid" and "mesh" in body) or (body.get("type") == "flexible" and none):
        return "meshed"
    return body.get("type")


Body = Annotated[
    Annotated[Ground, Tag("ground")]
    | Annotated[RigidBody, Tag("rigid")]
    | Annotated[FlexibleBody, Tag("flexible")]
    | Annotated[MeshedRigidBody, Tag("meshed")],
    Discriminator(_which),
]


class IdealJoint(Part):
    """Two frames; the axes of motion are those of the first, its axis is z.

    A free joint holds nothing: it says that a body shall fly. The motion of each type is in `pipeline.dynamics.joints`.
    type: which motion it leaves free.  between: first frame, whose axes are those of motion, and second frame, each as
    body.FRAME.  friction: follows the force that the joint carries; absent means none.
    """

    type: Literal["spherical", "revolute", "universal", "prismatic", "cylindrical", "planar", "fixed", "free"]
    between: tuple[FrameName, FrameName]
    friction: JointFriction | None = None

    @model_validator(mode="after")
    def _rubs(self) -> Self:
        if self.friction is not None:
            require_fitting(self.type, self.friction)
        return self


#: types of ideal joints
IDEAL: tuple[str, ...] = get_args(IdealJoint.model_fields["type"].annotation)
Joint = Annotated[
    IdealJoint | ClearanceSpherical | ClearanceRevolute | ClearanceSlot | BallOnPlane, Field(discriminator="type")
]
