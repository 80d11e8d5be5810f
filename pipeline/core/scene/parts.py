"""The parts of a scene: bodies and joints. An effect is a part; absent means not there."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.core.scene.fields import (
    AngularVelocity,
    FrameName,
    Inertia,
    Length,
    Mass,
    Number,
    Part,
    Pose,
    Position,
    Pressure,
    Speed,
    Velocity,
)

Positive = Field(gt=0.0)


class Ground(Part):
    """The fixed world; listed only to give it frames."""

    type: Literal["ground"]
    frames: dict[str, Pose] = Field(default_factory=dict)


class RigidBody(Part):
    """Mass, centre of mass and inertia about it, all in the body frame."""

    type: Literal["rigid"]
    mass: Annotated[Mass, Positive]
    com: Position = (0.0, 0.0, 0.0)
    inertia: Inertia
    pose: Pose | None = Field(
        default=None, description="start pose of the body frame; without it, it follows from a joint"
    )
    velocity: Velocity | None = Field(default=None, description="start velocity of the centre of mass, world axes")
    angular_velocity: AngularVelocity | None = Field(default=None, description="start angular velocity, world axes")
    frames: dict[str, Pose] = Field(default_factory=dict)


class Modes(Part):
    """Which elastic coordinates a flexible body keeps.

    count: number of elastic coordinates, static (constraint) modes included.
    interfaces: the recipe's frames that a Craig-Bampton basis keeps; default: the recipe's own list.
    """

    reference: str
    count: Annotated[int, Field(ge=1)]
    interfaces: tuple[str, ...] | None = None


class FlexibleBody(Part):
    """A body reduced from a mesh; its frames are those of the recipe.

    pose: start pose of the undeformed mesh frame.
    damping: modal damping ratio of every elastic coordinate; absent means none.
    """

    type: Literal["flexible"]
    mesh: str
    modes: Modes
    damping: Annotated[Number, Field(gt=0.0)] | None = None
    pose: Pose | None = None
    velocity: Velocity | None = None
    angular_velocity: AngularVelocity | None = None


Body = Annotated[Ground | RigidBody | FlexibleBody, Field(discriminator="type")]


class IdealJoint(Part):
    """Two frames; the axes of motion are those of the first, its axis is z.

    A free joint holds nothing: it says that a body shall fly.
    """

    type: Literal["spherical", "revolute", "universal", "prismatic", "cylindrical", "planar", "fixed", "free"]
    between: tuple[FrameName, FrameName]


class Material(Part):
    """Elastic constants of a contacting surface."""

    youngs_modulus: Annotated[Pressure, Positive]
    poisson: Annotated[Number, Field(ge=0.0, lt=0.5)]


class NormalLaw(Part):
    """A normal contact law; `stiffness` K [N/m^exponent] may be given instead of materials and radii."""

    law: str
    restitution: Annotated[Number, Field(ge=0.0, le=1.0)] | None = None
    exponent: Annotated[Number, Field(ge=1.0)] = 1.5
    stiffness: Annotated[Number, Positive] | None = None


class FrictionLaw(Part):
    """A friction law with the paper's four parameters (Table 6)."""

    law: str
    static: Annotated[Number, Field(ge=0.0)]
    dynamic: Annotated[Number, Field(ge=0.0)]
    v_static: Annotated[Speed, Positive]
    v_dynamic: Annotated[Speed, Positive]

    @model_validator(mode="after")
    def _ordered(self) -> FrictionLaw:
        if not self.v_static < self.v_dynamic:
            raise ValueError(
                f"v_static = {self.v_static} m/s is below v_dynamic = {self.v_dynamic} m/s in a Stribeck curve"
            )
        return self


class ClearanceSpherical(Part):
    """Ball in socket with radial clearance; between = [socket frame, ball frame].

    floor: least approach speed used as the impact rate of a closing [m/s]; keeps the law regular
    for grazing and resting contact.
    """

    type: Literal["clearance-spherical"]
    between: tuple[FrameName, FrameName]
    clearance: Annotated[Length, Positive]
    ball_radius: Annotated[Length, Positive]
    socket_material: Material | None = None
    ball_material: Material | None = None
    normal: NormalLaw
    friction: FrictionLaw | None = None
    floor: Annotated[Speed, Positive] = 1e-6

    @model_validator(mode="after")
    def _stiffness_known(self) -> ClearanceSpherical:
        if self.normal.stiffness is None and (self.socket_material is None or self.ball_material is None):
            raise ValueError(
                "the contact stiffness is unknown: give socket_material and ball_material, or normal.stiffness"
            )
        return self


Joint = Annotated[IdealJoint | ClearanceSpherical, Field(discriminator="type")]
