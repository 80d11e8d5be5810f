"""Mesh recipes: the schema of files under meshes/, including bodies that another finite element code assembled."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from flexclear.scene.fields import Part
from flexclear.scene.json_schema import identified
from flexclear.scene.load import RECIPE, read_toml, require_kind
from flexclear.scene.registry import suggestion
from flexclear.scene.validation_errors import input_errors
from flexclear.structure.fe.beam_recipe import SegmentedBeamRecipe, StraightBeamRecipe
from flexclear.structure.fe.recipe_parts import BodyRecipe, TurnedFrame
from flexclear.structure.fe.solid.recipe import SolidRecipe
from flexclear.system.errors import InputError


class Matrices(Part):
    """Stiffness and mass of a free body, with a table of their rows.

    Either `file`, an npz that `exchange.files.write_npz` wrote, or `stiffness` and `mass` (MatrixMarket) and
    `unknowns` (CSV with the columns node, x, y, z, component, one line per row of the matrices).
    """

    type: Literal["matrices"]
    units: Literal["m-kg-s", "mm-t-s", "mm-kg-ms"]
    """consistent units of all numbers in the files, which do not state them. Paths are relative to the recipe"""
    file: str | None = None
    """npz file with matrices, table and integrals"""
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


class TableFrame(TurnedFrame):
    """A named frame at a node with six unknowns, or following the mean motion of several (RBE3, equal weights)."""

    node: int | None = None
    """number from the table of unknowns"""
    nodes: tuple[int, ...] = ()
    """numbers from the table of unknowns"""

    @model_validator(mode="after")
    def _one_way(self) -> TableFrame:
        if (self.node is None) == (not self.nodes):
            raise ValueError("give either `node` or `nodes`")
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
    return identified({**whole, "allOf": chosen, **schema}, "recipe")
