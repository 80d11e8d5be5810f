"""Recipes of beams: straight rods (uniform, tapered or stepped), with lumped masses, in any pose."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from flexclear.scene.fields import Direction, Inertia, Length, Mass, Part, Pose, Position, Positive
from flexclear.scene.segments import SAME_PLACE
from flexclear.structure.fe.recipe_parts import BodyRecipe, Isotropic, TurnedFrame
from flexclear.structure.fe.section import DIMENSIONS, InertiaSection, StiffnessSection

Elements = Annotated[int, Field(ge=1, le=100_000)]


class StraightBeam(Part):
    """A beam along x of the rod frame, from x = 0 to `length`, cut into equal elements."""

    type: Literal["straight-beam"]
    length: Annotated[Length, Positive]
    """length of the rod"""


class Piece(Part):
    """A rod of one section or taper, cut into equal elements."""

    elements: Elements
    """number of elements"""
    section: StiffnessSection
    """cross section that gives area and stiffness"""
    end_section: StiffnessSection | None = None
    """section at the far end, when the rod tapers linearly from `section`; of the same type"""
    inertia_section: InertiaSection | None = None
    """cross section that gives the second moments of the mass; default: `section`"""

    @model_validator(mode="after")
    def _can_taper(self) -> Piece:
        start, end = self.section, self.end_section
        if end is None:
            return self
        if start.type not in DIMENSIONS:
            raise ValueError(f"a {start.type} section has no dimensions to taper; cut the rod into segments")
        if end.type != start.type:
            raise ValueError(f"a taper keeps the type of the section; it cannot go from {start.type} to {end.type}")
        if end.shear_coefficient is not None:
            raise ValueError("give the shear coefficient of a taper once, in `section`")
        return self


class Segment(Piece):
    """A piece of a stepped rod, cut into equal elements."""

    start: Length
    """position of its start and of its end along the rod"""
    end: Length
    """position of its start and of its end along the rod"""
    material: Isotropic | None = None
    """its material, where it differs from the recipe's"""

    @model_validator(mode="after")
    def _has_a_length(self) -> Segment:
        if not self.start < self.end:
            raise ValueError(f"a segment must end after its start, not at {self.end:g} m after {self.start:g} m")
        return self


class SegmentedBeam(Part):
    """A beam along x of the rod frame, from x = 0 to `length`, of segments that cover it without gap or overlap."""

    type: Literal["segmented-beam"]
    length: Annotated[Length, Positive]
    """length of the rod"""
    segments: tuple[Segment, ...]
    """segments in their order along the rod"""

    @model_validator(mode="after")
    def _check_coverage(self) -> SegmentedBeam:
        close = SAME_PLACE * self.length
        ends = [("the rod", 0.0, 0.0), *((f"segment {k}", s.start, s.end) for k, s in enumerate(self.segments))]
        ends.append(("the rod's end", self.length, self.length))
        for (before, _, end), (after, start, _) in pairwise(ends):
            if abs(start - end) > close:
                kind = "a gap" if start > end else "an overlap"
                raise ValueError(
                    f"segments cover the rod from 0 to {self.length:g} m in their order; between {before} "
                    f"({end:g} m) and {after} ({start:g} m) there is {kind}"
                )
        return self


class LumpedMass(Part):
    """A rigid mass attached to the node at `x` (a ball, a stem)."""

    x: Length
    """position along the rod"""
    mass: Annotated[Mass, Positive]
    """its mass"""
    com: Position = (0.0, 0.0, 0.0)
    """its centre of mass relative to the node; `inertia`: about that centre [x, y, z]; both in axes of the rod frame"""
    inertia: Inertia = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


#: columns: x, y, z of a named frame in rod axes, unless the recipe gives others; z runs along the beam
FRAME_ROTATION = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


class NodeFrame(TurnedFrame):
    """A named frame at a node."""

    x: Length
    """position along the rod, at a node"""
    axes: dict[str, Direction] | tuple[Direction, Direction, Direction] | None = None
    """axes as in a pose, directions in the rod's axes; default: z along the beam (x of the rod), x = y of the rod. A
    joint turns about z, so a pin across the beam needs other axes: ``axes = { z = [0, 0, 1], x = [1, 0, 0] }``"""
    axis: Direction | None = None
    """direction of z alone, as in a pose: ``axis = [0, 0, 1]``"""
    default: ClassVar[np.ndarray] = FRAME_ROTATION


class BeamRecipe(BodyRecipe):
    """Keys of every beam recipe."""

    material: Isotropic
    """elastic constants and density"""
    theory: Literal["euler-bernoulli", "rayleigh", "timoshenko"] = "rayleigh"
    """theory of bending: Euler-Bernoulli has no rotary inertia, Rayleigh has it, Timoshenko adds shear deformation"""
    torsion: Literal["linear", "quadratic"] = "linear"
    """degree of the twist and of the axial displacement in an element"""
    extension: Literal["linear", "quadratic"] = "linear"
    """degree of the twist and of the axial displacement in an element"""
    pose: Pose = Pose()
    """pose of the rod frame in the mesh frame"""
    masses: dict[str, LumpedMass] = Field(default_factory=dict)
    """lumped masses by name"""
    frames: Annotated[dict[str, NodeFrame], Field(min_length=1)]
    """named frames at nodes"""

    @model_validator(mode="after")
    def _shear_known(self) -> BeamRecipe:
        for k, piece in enumerate(segments(self)):
            section = piece.section
            if self.theory == "timoshenko" and section.type == "general" and section.shear_coefficient is None:
                where = f"shape.segments.{k}.section" if isinstance(self, SegmentedBeamRecipe) else "section"
                raise ValueError(
                    f"{where}: a Timoshenko beam needs the shear coefficient of a general section; "
                    "give shear_coefficient, or choose the theory 'rayleigh'"
                )
        return self


class StraightBeamRecipe(Piece, BeamRecipe):
    """A uniform or linearly tapered rod."""

    shape: StraightBeam
    """the rod"""


class SegmentedBeamRecipe(BeamRecipe):
    """A rod whose section changes in steps."""

    shape: SegmentedBeam
    """the rod and its pieces"""


def segments(recipe: BeamRecipe) -> tuple[Segment, ...]:
    """Return the recipe's segments; a straight beam has one."""
    if isinstance(recipe, SegmentedBeamRecipe):
        return recipe.shape.segments
    assert isinstance(recipe, StraightBeamRecipe)
    of_piece = {name: getattr(recipe, name) for name in Piece.model_fields}
    return (Segment.model_construct(start=0.0, end=recipe.shape.length, **of_piece),)
