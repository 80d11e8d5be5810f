"""The parts of a scene: bodies, joints, drives, loads. An effect is a part; absent means not there."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.core.scene.clearance import ClearanceRevolute, ClearanceSpherical, FrameName
from pipeline.core.scene.fields import (
    Acceleration,
    AngularVelocity,
    Inertia,
    Length,
    Mass,
    Number,
    Part,
    Pose,
    Position,
    Time,
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
    """Two frames; the axes of motion are those of the first, its axis is z."""

    type: Literal["spherical", "revolute", "planar", "prismatic", "fixed"]
    between: tuple[FrameName, FrameName]


Joint = Annotated[IdealJoint | ClearanceSpherical | ClearanceRevolute, Field(discriminator="type")]


class Constant(Part):
    """The coordinate keeps a value."""

    type: Literal["constant"]
    value: Length = 0.0


class Step(Part):
    """ADAMS STEP: a cubic from one value to the next, flat outside; several are summed (eq. 29, 35)."""

    type: Literal["step"]
    start: tuple[Time, ...]
    end: tuple[Time, ...]
    change: tuple[Length, ...]

    @field_validator("change")
    @classmethod
    def _not_empty(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if not value:
            raise ValueError("a step law has at least one step")
        return value

    @model_validator(mode="after")
    def _same_length(self) -> Step:
        if not len(self.start) == len(self.end) == len(self.change):
            raise ValueError("start, end and change have one entry per step each")
        if any(not a < b for a, b in zip(self.start, self.end, strict=True)):
            raise ValueError("each step ends after it starts")
        return self


DriveLaw = Annotated[Constant | Step, Field(discriminator="type")]


class Drive(Part):
    """Prescribes the coordinate of a prismatic or revolute joint."""

    joint: str
    law: DriveLaw


class Gravity(Part):
    """Uniform acceleration field, world axes."""

    type: Literal["gravity"]
    acceleration: Acceleration


Load = Gravity
