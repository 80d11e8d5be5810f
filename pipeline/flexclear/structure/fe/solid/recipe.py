"""Recipes of solids: blocks and cylinders that are meshed here, and meshes from files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from flexclear.scene.fields import Direction, Length, Part, Position, Positive
from flexclear.structure.fe.recipe_parts import BodyRecipe, Isotropic, TurnedFrame

Cells = Annotated[int, Field(ge=1, le=1000)]
ElementName = Literal["hex8", "hex20", "hex27", "tet4", "tet10"]


class CylinderCells(Part):
    """Numbers of cells: along the axis, along a side of the section's square core, and rings around the core."""

    along: Cells
    """cells along the axis, along a side of the core, and rings around it"""
    across: Cells
    """cells along the axis, along a side of the core, and rings around it"""
    rings: Cells
    """cells along the axis, along a side of the core, and rings around it"""


class Cylinder(Part):
    """A round rod along x of the mesh frame, from x = 0 to `length`. Regions: body, start, end, side."""

    type: Literal["cylinder"]
    radius: Annotated[Length, Positive]
    """radius and length of the rod"""
    length: Annotated[Length, Positive]
    """radius and length of the rod"""
    cells: CylinderCells
    """numbers of cells"""
    element: ElementName = "hex27"
    """type of the cells"""


class Block(Part):
    """A box from x = 0 to size[0], centred in y and z. Regions: body, start (x = 0), end, side."""

    type: Literal["block"]
    size: Position
    """lengths along x, y, z"""
    cells: tuple[Cells, Cells, Cells]
    """numbers of cells along x, y, z"""
    element: ElementName = "hex27"
    """type of the cells"""

    @model_validator(mode="after")
    def _has_a_volume(self) -> Block:
        if not min(self.size) > 0.0:
            raise ValueError(f"the sides {list(self.size)} m of a block must be positive")
        return self


class MeshFile(Part):
    """A mesh of tetrahedra or of hexahedra in a file that meshio reads; `file` is relative to the recipe."""

    type: Literal["mesh-file"]
    file: str
    """path of the mesh, relative to the recipe"""
    length_unit: Literal["m", "cm", "mm", "um", "in"]
    """unit of the coordinates, which the file does not state"""


class StepFile(Part):
    """A solid of a STEP file, meshed by Gmsh (`pip install 'flexclear[cad]'`); the file states its own unit."""

    type: Literal["step"]
    file: str
    """path of the STEP file, relative to the recipe"""
    size: Annotated[Length, Positive]
    """largest size of the cells; round surfaces have smaller ones"""
    solid: Annotated[int, Field(ge=1)] = 1
    """number of the solid in the file, from 1"""
    element: Literal["tet4", "tet10"] = "tet10"
    """type of the cells"""


def _require_direction(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(direction):
        raise ValueError("a direction must not have length zero")
    return direction


Pointing = Annotated[Direction, AfterValidator(_require_direction)]


class Plane(Part):
    """Nodes on a plane."""

    point: Position
    """a point of the plane and its normal"""
    normal: Pointing
    """a point of the plane and its normal"""


class Tube(Part):
    """Nodes on a cylinder's surface around the line through `point` along `axis`."""

    point: Position
    """a point of the axis, its direction, and the radius"""
    axis: Pointing
    """a point of the axis, its direction, and the radius"""
    radius: Annotated[Length, Positive]
    """a point of the axis, its direction, and the radius"""


class Sphere(Part):
    """Nodes on a sphere's surface."""

    centre: Position
    """centre and radius of the sphere"""
    radius: Annotated[Length, Positive]
    """centre and radius of the sphere"""


class On(Part):
    """Selects the nodes that a frame is tied to: those of a named region, or on a surface; boundary nodes only."""

    region: str | None = None
    """a named region of the mesh"""
    plane: Plane | None = None
    """surface on which the nodes lie"""
    cylinder: Tube | None = None
    """surface on which the nodes lie"""
    sphere: Sphere | None = None
    """surface on which the nodes lie"""
    tolerance: Annotated[Length, Positive] | None = None
    """largest distance from the surface; default: 1e-6 of the body's size"""

    @model_validator(mode="after")
    def _one_rule(self) -> On:
        rules = ("region", "plane", "cylinder", "sphere")
        given = [name for name in rules if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give exactly one of {', '.join(rules)}, not {' and '.join(given) or 'none'}")
        return self


class TiedFrame(TurnedFrame):
    """A named frame tied to nodes: rigidly (RBE2; they move as one), or to their mean motion (RBE3; they deform)."""

    on: On
    """selects the nodes"""
    tie: Literal["rigid", "mean"]
    """rigid (RBE2) or mean (RBE3)"""
    position: Position | None = None
    """origin in the mesh frame; default: the centre of the nodes"""


class SolidRecipe(BodyRecipe):
    """A solid body."""

    shape: Annotated[Cylinder | Block | MeshFile | StepFile, Field(discriminator="type")]
    """shape of the solid"""
    material: Isotropic | None = None
    """material of all cells; `materials` gives one for each region"""
    materials: dict[str, Isotropic] = Field(default_factory=dict)
    """elastic constants and density by region"""
    frames: Annotated[dict[str, TiedFrame], Field(min_length=1)]
    """named frames and their nodes"""

    @model_validator(mode="after")
    def _require_one_material(self) -> SolidRecipe:
        if (self.material is None) == (not self.materials):
            raise ValueError("give either `material` for the whole body or `materials` by region")
        return self
