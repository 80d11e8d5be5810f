"""Recipes of bodies that another finite element code has assembled."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from flexclear.pipeline.core.scene.fields import Part
from flexclear.pipeline.structure.fe.recipe_parts import BodyRecipe, TurnedFrame


class Matrices(Part):
    """Stiffness and mass of a free body, and a table of what their rows are.

    Either `file`, an npz as `exchange.files.write_npz` makes it, or `stiffness` and `mass` (MatrixMarket) and
    `unknowns` (CSV with the columns node, x, y, z, component, one line per row of the matrices).
    """

    type: Literal["matrices"]
    units: Literal["m-kg-s", "mm-t-s", "mm-kg-ms"]
    """the consistent system of all numbers in the files; a file does not say. Paths are relative to the recipe"""
    file: str | None = None
    """npz with everything"""
    stiffness: str | None = None
    """MatrixMarket files"""
    mass: str | None = None
    """MatrixMarket files"""
    unknowns: str | None = None
    """CSV table of the rows"""

    @model_validator(mode="after")
    def _one_way(self) -> Matrices:
        three = [name for name in ("stiffness", "mass", "unknowns") if getattr(self, name) is not None]
        if (self.file is None) == (not three) or (three and len(three) < 3):
            raise ValueError("give either `file`, or all of `stiffness`, `mass` and `unknowns`")
        return self


class NodeFrame(TurnedFrame):
    """A named frame at a node with six unknowns, or following the mean motion of several (RBE3, equal weights)."""

    node: int | None = None
    """number from the table of unknowns"""
    nodes: tuple[int, ...] = ()
    """numbers from the table of unknowns"""

    @model_validator(mode="after")
    def _one_way(self) -> NodeFrame:
        if (self.node is None) == (not self.nodes):
            raise ValueError("give either `node` or `nodes`")
        return self


class MatricesRecipe(BodyRecipe):
    """A body given by its matrices."""

    shape: Matrices
    """files of the matrices"""
    frames: Annotated[dict[str, NodeFrame], Field(min_length=1)]
    """named frames and their nodes"""
