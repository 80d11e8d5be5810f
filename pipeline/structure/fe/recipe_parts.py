"""What recipes of several kinds of bodies share: material, frames with axes of their own, the list of interfaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from flexclear.pipeline.core.scene.fields import Density, Direction, Number, Part, Pose, Pressure, given_once
from flexclear.pipeline.core.scene.registry import suggestion

Positive = Field(gt=0.0)


class Isotropic(Part):
    """A linear elastic, isotropic material."""

    density: Annotated[Density, Positive]
    """mass density"""
    youngs_modulus: Annotated[Pressure, Positive]
    """Young's modulus"""
    poisson: Annotated[Number, Field(gt=-1.0, lt=0.5)]
    """Poisson's ratio"""

    @property
    def shear_modulus(self) -> float:
        """E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson))


class TurnedFrame(Part):
    """A named frame with axes of its own, as of a pose (`axes`, or `axis` for z alone); default: the mesh's."""

    axes: dict[str, Direction] | tuple[Direction, Direction, Direction] | None = None
    """as of a pose"""
    axis: Direction | None = None
    """as of a pose, the direction of z alone"""

    @model_validator(mode="after")
    def _orthogonal_axes(self) -> TurnedFrame:
        given_once(self, ("axes", "axis"))
        self.orientation()
        return self

    def orientation(self) -> Pose:
        """The orientation as a pose at the origin."""
        return Pose(axes=self.axes, axis=self.axis)


def check_interfaces(interfaces: tuple[str, ...], frames: Mapping[str, object]) -> None:
    """ValueError unless every interface is a frame of the recipe, named once."""
    for name in interfaces:
        if name not in frames:
            raise ValueError(f"interface '{name}' is no frame of the recipe; {suggestion(name, frames)}")
    if len(set(interfaces)) < len(interfaces):
        raise ValueError(f"interfaces {list(interfaces)} name a frame twice")
