"""Mesh recipes: what a file under meshes/ may say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from flexclear.pipeline.core.scene.json_schema import identified
from flexclear.pipeline.core.scene.load import RECIPE, read_toml, require_kind
from flexclear.pipeline.core.scene.registry import suggestion
from flexclear.pipeline.core.scene.validation_errors import input_errors
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.beam_recipe import SegmentedBeamRecipe, StraightBeamRecipe
from flexclear.pipeline.structure.fe.exchange.recipe import MatricesRecipe
from flexclear.pipeline.structure.fe.solid.recipe import SolidRecipe

#: every kind of recipe; `Recipe` is any of them
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
    """The recipe in a TOML file as a plain table in SI units; InputError names every mistake in it."""
    table = read_toml(Path(path))
    require_kind(table, Path(path), RECIPE)
    return parse(table, str(path)).model_dump(mode="json", exclude_none=True)


def parse(table: Mapping[str, Any], where: str) -> Any:
    """The recipe that a table holds, one of MODELS; `where` opens every message of an InputError."""
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
        raise InputError(f"{where} [shape.type]", f"no shape is called {name!r}", suggestion(str(name), MODELS))
    return MODELS[name]


def recipe_schema() -> dict[str, Any]:
    """The schema of a recipe file: which keys there are depends on `shape.type`."""
    adapter: TypeAdapter[Any] = TypeAdapter(Recipe)
    schema = adapter.json_schema(mode="validation")
    branches = schema.pop("anyOf")
    shapes = {
        kind: next(b for b in branches if b["$ref"].endswith(f"/{model.__name__}")) for kind, model in MODELS.items()
    }
    # a choice by the shape, so that an editor reports what is wrong with this kind and not with all others
    chosen = [
        {
            "if": {"properties": {"shape": {"properties": {"type": {"const": kind}}, "required": ["type"]}}},
            "then": branch,
        }
        for kind, branch in shapes.items()
    ]
    shape = {"type": "object", "required": ["type"], "properties": {"type": {"enum": list(MODELS)}}}
    whole = {"title": "Recipe", "type": "object", "required": ["shape"], "properties": {"shape": shape}}
    return identified({**whole, "allOf": chosen, **schema}, "recipe")
