"""Parts of recipes of several kinds of bodies: material, frames with their own axes, the list of interfaces."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from flexclear.numerics.rotations import axes_to_matrix, axis_to_matrix
from flexclear.scene.fields import Density, Direction, Number, Part, Positive, Pressure, given_once
from flexclear.scene.registry import suggestion


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
        """Shear modulus E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson))


class TurnedFrame(Part):
    """A named frame with its own axes, as in a pose (`axes`, or `axis` for z alone); default: the axes of the mesh."""

    axes: dict[str, Direction] | tuple[Direction, Direction, Direction] | None = None
    """axes, as in a pose"""
    axis: Direction | None = None
    """direction of z alone, as in a pose"""
    default: ClassVar[np.ndarray] = np.eye(3)

    @model_validator(mode="after")
    def _orthogonal_axes(self) -> TurnedFrame:
        given_once(self, ("axes", "axis"))
        self.orientation()
        return self

    def orientation(self) -> np.ndarray:
        """Return the rotation of the frame; columns: its x, y, z in axes of the mesh."""
        if self.axis is not None:
            return axis_to_matrix(self.axis)
        return self.default if self.axes is None else axes_to_matrix(self.axes)


class BodyRecipe(Part):
    """Keys of every recipe."""

    title: str = ""
    """description of the body"""
    frames: Annotated[dict[str, Any], Field(min_length=1)]
    """named frames"""
    interfaces: tuple[str, ...] = ()
    """frames at which the body is joined to others; the first carries the body frame of a Craig-Bampton basis"""

    @model_validator(mode="after")
    def _interfaces_are_frames(self) -> BodyRecipe:
        for name in self.interfaces:
            if name not in self.frames:
                raise ValueError(f"interface '{name}' is not a frame of the recipe; {suggestion(name, self.frames)}")
        if len(set(self.interfaces)) < len(self.interfaces):
            raise ValueError(f"interfaces {list(self.interfaces)} name a frame twice")
        return self
