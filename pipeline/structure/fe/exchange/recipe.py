"""Recipes of bodies that another finite element code has assembled."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.core.registry import suggestion
from pipeline.core.scene.fields import Direction, Part, Pose


class Matrices(Part):
    """Stiffness and mass of a free body, and a table of what their rows are.

    Either `file`, an npz as `exchange.files.write_npz` makes it, or `stiffness` and `mass` (MatrixMarket) and
    `unknowns` (CSV with the columns node, x, y, z, component, one line per row of the matrices).
    units: the consistent system of all numbers in the files; a file does not say. Paths are relative to the recipe.
    """

    type: Literal["matrices"]
    units: Literal["m-kg-s", "mm-t-s", "mm-kg-ms"]
    file: str | None = None
    stiffness: str | None = None
    mass: str | None = None
    unknowns: str | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Matrices:
        three = [name for name in ("stiffness", "mass", "unknowns") if getattr(self, name) is not None]
        if (self.file is None) == (not three) or (three and len(three) < 3):
            raise ValueError("give either `file`, or all of `stiffness`, `mass` and `unknowns`")
        return self


class NodeFrame(Part):
    """A named frame at a node with six unknowns, or following the mean motion of several nodes (RBE3, equal weights).

    node, nodes: numbers from the table of unknowns.  axes: as of a pose; default: the axes of the matrices.
    """

    node: int | None = None
    nodes: tuple[int, ...] = ()
    axes: dict[str, Direction] | tuple[Direction, Direction, Direction] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> NodeFrame:
        if (self.node is None) == (not self.nodes):
            raise ValueError("give either `node` or `nodes`")
        self.orientation()
        return self

    def orientation(self) -> Pose:
        """The orientation as a pose at the origin."""
        return Pose(axes=self.axes)


class MatricesRecipe(Part):
    """A body given by its matrices. interfaces: frames at which the body is joined to others."""

    title: str = ""
    shape: Matrices
    frames: Annotated[dict[str, NodeFrame], Field(min_length=1)]
    interfaces: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _known(self) -> MatricesRecipe:
        for name in self.interfaces:
            if name not in self.frames:
                raise ValueError(
                    f"interfaces: there is no frame called '{name}'; {suggestion(name, dict(self.frames))}"
                )
        return self
