"""JSON schema of mesh recipes."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from flexclear.pipeline.core.scene.json_schema import identified
from flexclear.pipeline.structure.fe.recipe import MODELS, Recipe


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
