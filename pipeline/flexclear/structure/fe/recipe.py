"""Mesh recipes: the schema of files under meshes/, including bodies that another finite element code assembled."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from flexclear.scene.fields import Part
from flexclear.scene.json_schema import with_identity
from flexclear.scene.load import RECIPE, require_kind
from flexclear.scene.registry import suggestion
from flexclear.scene.toml_files import read_toml
from flexclear.scene.validation_errors import input_errors
from flexclear.structure.fe.beam_recipe import SegmentedBeamRecipe, StraightBeamRecipe
from flexclear.structure.fe.recipe_parts import BodyRecipe, TurnedFrame
from flexclear.structure.fe.solid.recipe import SolidRecipe
from flexclear.system.errors import InputError


class Matrices(Part):
    """Stiffness and mass of a free body from another program, in one `file` or in the two `stiffness` and `mass`.

    The end of a name decides the format: docs/exchange.md lists them. Paths are relative to the recipe.
    """

    type: Literal["matrices"]
    units: Literal["m-kg-s", "mm-t-s", "mm-kg-ms", "in-slinch-s"]
    """consistent units of all numbers in the files, which do not state them"""
    file: str | None = None
    """one file with both matrices: npz, HDF5, DMIG in .pch, .op4, .full"""
    stiffness: str | None = None
    """file of the stiffness matrix: MatrixMarket, .sti, .mtx of Abaqus, .pch, .op4"""
    mass: str | None = None
    """file of the mass matrix, in the same format"""
    unknowns: str | None = None
    """rows of matrices that have numbers only: .dof, or a CSV table with the columns node, x, y, z, component"""
    nodes: str | None = None
    """deck with positions and sets of the nodes: .inp, .cdb, or entries GRID of Nastran"""
    basis: str | None = None
    """MatrixMarket file of shapes by columns, such as a Craig-Bampton basis; for modes of the reference "given"."""
    listing: str | None = None
    """the program's list of the free body's frequencies (.dat, .f06), which are compared with those computed here"""

    @model_validator(mode="after")
    def _one_way(self) -> Matrices:
        two = [name for name in ("stiffness", "mass") if getattr(self, name) is not None]
        if (self.file is None) == (not two) or len(two) == 1:
            raise ValueError("give either `file`, or both of `stiffness` and `mass`")
        return self


class TableFrame(TurnedFrame):
    """A named frame at a node with six unknowns, or following the mean motion of several (RBE3, equal weights)."""

    node: int | None = None
    """number of a node"""
    nodes: tuple[int, ...] = ()
    """numbers of several nodes"""
    set: str | None = None
    """name of a set of nodes in the deck"""

    @model_validator(mode="after")
    def _one_way(self) -> TableFrame:
        if [self.node is not None, bool(self.nodes), self.set is not None].count(True) != 1:
            raise ValueError("give either `node` or `nodes` or `set`")
        return self


class MatricesRecipe(BodyRecipe):
    """A body given by its matrices."""

    shape: Matrices
    """files of the matrices"""
    frames: Annotated[dict[str, TableFrame], Field(min_length=1)]
    """named frames and their nodes"""


#: union of all kinds of recipes
Recipe = StraightBeamRecipe | SegmentedBeamRecipe | SolidRecipe | MatricesRecipe
#: recipe model by `shape.type`
MODELS: dict[str, type[Recipe]] = {
    "straight-beam": StraightBeamRecipe,
    "segmented-beam": SegmentedBeamRecipe,
    "cylinder": SolidRecipe,
    "block": SolidRecipe,
    "mesh-file": SolidRecipe,
    "step": SolidRecipe,
    "matrices": MatricesRecipe,
}


def read_recipe(path: str | Path) -> dict[str, Any]:
    """Return the recipe of a TOML file as a plain table in SI units; raise InputError that lists all its errors."""
    table = read_toml(Path(path))
    require_kind(table, Path(path), RECIPE)
    return parse(table, str(path)).model_dump(mode="json", exclude_none=True)


def parse(table: Mapping[str, Any], where: str) -> Any:
    """Return the recipe that a table holds, one of MODELS; `where` begins every message of an InputError."""
    model = _model(table, where)
    try:
        return model.model_validate(dict(table))
    except ValidationError as error:
        raise input_errors(where, error, model) from None


def _model(table: Mapping[str, Any], where: str) -> type[Recipe]:
    shape = table.get("shape")
    name = shape.get("type") if isinstance(shape, Mapping) else None
    if name is None:
        raise InputError(f"{where} [shape.type]", "is missing", "known: " + ", ".join(MODELS))
    if not isinstance(name, str) or name not in MODELS:
        raise InputError(f"{where} [shape.type]", f"unknown shape {name!r}", suggestion(str(name), MODELS))
    return MODELS[name]


def recipe_schema() -> dict[str, Any]:
    """Return the JSON schema of a recipe file; the allowed keys depend on `shape.type`."""
    adapter: TypeAdapter[Any] = TypeAdapter(Recipe)
    schema = adapter.json_schema(mode="validation")
    del schema["anyOf"]
    # selected by the shape, so that an editor reports errors of this kind of recipe only
    chosen = [
        {
            "if": {"properties": {"shape": {"properties": {"type": {"const": kind}}, "required": ["type"]}}},
            "then": {"$ref": f"#/$defs/{model.__name__}"},
        }
        for kind, model in MODELS.items()
    ]
    shape = {"type": "object", "required": ["type"], "properties": {"type": {"enum": list(MODELS)}}}
    whole = {"title": "Recipe", "type": "object", "required": ["shape"], "properties": {"shape": shape}}
    return with_identity({**whole, "allOf": chosen, **schema}, "recipe")
