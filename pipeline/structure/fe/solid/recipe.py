"""Recipes of solids: blocks and cylinders that are meshed here, and meshes from files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from flexclear.pipeline.core.scene.fields import Direction, Length, Part, Position
from flexclear.pipeline.structure.fe.recipe_parts import BodyRecipe, Isotropic, Positive, TurnedFrame

Cells = Annotated[int, Field(ge=1, le=1000)]
ElementName = Literal["hex8", "hex20", "hex27", "tet4", "tet10"]


class CylinderCells(Part):
    """Numbers of cells: along the axis, along a side of the section's square core, and rings around the core.

    along, across, rings: cells along the axis, along a side of the core, and rings around it.
    """

    along: Cells
    across: Cells
    rings: Cells


class Cylinder(Part):
    """A round rod along x of the mesh frame, from x = 0 to `length`. Regions: body, start, end, side.

    radius, length: of the rod.  cells: how it is cut.  element: type of the cells.
    """

    type: Literal["cylinder"]
    radius: Annotated[Length, Positive]
    length: Annotated[Length, Positive]
    cells: CylinderCells
    element: ElementName = "hex27"


class Block(Part):
    """A box from x = 0 to size[0], centred in y and z. Regions: body, start (x = 0), end, side.

    size: lengths along x, y, z.  cells: numbers along x, y, z.  element: type of the cells.
    """

    type: Literal["block"]
    size: Position
    cells: tuple[Cells, Cells, Cells]
    element: ElementName = "hex27"

    @model_validator(mode="after")
    def _has_a_volume(self) -> Block:
        if not min(self.size) > 0.0:
            raise ValueError(f"the sides {list(self.size)} m of a block are positive")
        return self


class MeshFile(Part):
    """A mesh of tetrahedra or of hexahedra in a file that meshio reads; `file` is relative to the recipe.

    length_unit: unit of the file's coordinates; a file does not say.
    file: the mesh, relative to the recipe.
    """

    type: Literal["mesh-file"]
    file: str
    length_unit: Literal["m", "cm", "mm", "um", "in"]


def _pointing(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(direction):
        raise ValueError("a direction must not have the length zero")
    return direction


Pointing = Annotated[Direction, AfterValidator(_pointing)]


class Plane(Part):
    """Nodes on a plane.

    point, normal: a point of the plane and its normal.
    """

    point: Position
    normal: Pointing


class Tube(Part):
    """Nodes on a cylinder's surface around the line through `point` along `axis`.

    point, axis, radius: a point of the axis, its direction, and the radius.
    """

    point: Position
    axis: Pointing
    radius: Annotated[Length, Positive]


class Sphere(Part):
    """Nodes on a sphere's surface.

    centre, radius: of the sphere.
    """

    centre: Position
    radius: Annotated[Length, Positive]


class On(Part):
    """Which nodes a frame is tied to: those of a named region, or on a surface; on the boundary of the body only.

    tolerance: largest distance from the surface; default: 1e-6 of the body's size.
    region: a named region of the mesh.  plane, cylinder, sphere: a surface.
    """

    region: str | None = None
    plane: Plane | None = None
    cylinder: Tube | None = None
    sphere: Sphere | None = None
    tolerance: Annotated[Length, Positive] | None = None

    @model_validator(mode="after")
    def _one_rule(self) -> On:
        rules = ("region", "plane", "cylinder", "sphere")
        given = [name for name in rules if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"one of {', '.join(rules)} says where, not {' and '.join(given) or 'none'}")
        return self


class TiedFrame(TurnedFrame):
    """A named frame tied to nodes: rigidly (RBE2; they move as one), or to their mean motion (RBE3; they deform).

    position: origin in the mesh frame; default: the centre of the nodes.
    on: which nodes.  tie: rigid or mean.
    """

    on: On
    tie: Literal["rigid", "mean"]
    position: Position | None = None


class SolidRecipe(BodyRecipe):
    """A solid body.

    material: of all cells, or materials: by region.
    shape: the solid.  materials: elastic constants and density by region.  frames: named frames and their nodes.
    """

    shape: Annotated[Cylinder | Block | MeshFile, Field(discriminator="type")]
    material: Isotropic | None = None
    materials: dict[str, Isotropic] = Field(default_factory=dict)
    frames: Annotated[dict[str, TiedFrame], Field(min_length=1)]

    @model_validator(mode="after")
    def _complete(self) -> SolidRecipe:
        if (self.material is None) == (not self.materials):
            raise ValueError("give either `material` for the whole body or `materials` by region")
        return self
