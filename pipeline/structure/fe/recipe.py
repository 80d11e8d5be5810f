"""Mesh recipes: what a file under meshes/ may say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pipeline.core.errors import InputError
from pipeline.core.registry import suggestion
from pipeline.core.scene.fields import Part, Source
from pipeline.core.scene.load import read_toml
from pipeline.core.scene.mistakes import input_errors
from pipeline.structure.fe.beam_recipe import SegmentedBeamRecipe, StraightBeamRecipe
from pipeline.structure.fe.exchange.recipe import MatricesRecipe
from pipeline.structure.fe.solid.recipe import SolidRecipe

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
#: parts whose sources are told first; the others follow in the order of the model
FIRST = ("shape", "material", "section", "end_section", "inertia_section")


def read_recipe(path: str | Path) -> dict[str, Any]:
    """The recipe in a TOML file as a plain table in SI units; InputError names every mistake in it."""
    return parse(read_toml(Path(path)), str(path)).model_dump(mode="json", exclude_none=True)


def parse(table: Mapping[str, Any], place: str) -> Recipe:
    """The recipe that a table holds; `place` opens every message of an InputError."""
    model = _model(table, place)
    try:
        return model.model_validate(dict(table))
    except ValidationError as error:
        raise input_errors(place, error, model) from None


def _model(table: Mapping[str, Any], place: str) -> type[Recipe]:
    shape = table.get("shape")
    name = shape.get("type") if isinstance(shape, Mapping) else None
    if name is None:
        raise InputError(f"{place} [shape.type]", "is missing", "known: " + ", ".join(MODELS))
    if not isinstance(name, str) or name not in MODELS:
        raise InputError(f"{place} [shape.type]", f"no shape is called {name!r}", suggestion(str(name), MODELS))
    return MODELS[name]


def sources(recipe: Part) -> str:
    """All `source` entries on one line, ``part: text; part.key: text``."""
    found = _flat("recipe", recipe.source)
    names = [name for name in type(recipe).model_fields if name != "source"]
    for name in sorted(names, key=lambda name: FIRST.index(name) if name in FIRST else len(FIRST)):
        for place, part in _parts(name, getattr(recipe, name)):
            found |= _flat(place, part.source)
    return "; ".join(f"{name}: {text}" for name, text in found.items())


def _parts(place: str, value: object) -> Iterator[tuple[str, Part]]:
    """Every part at and below a place."""
    if isinstance(value, Part):
        yield place, value
        value = {name: getattr(value, name) for name in type(value).model_fields}
    elif isinstance(value, tuple):
        value = dict(enumerate(value))
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _parts(f"{place}.{name}", inner)


def _flat(name: str, source: Source | None) -> dict[str, str]:
    if source is None:
        return {}
    return {name: source} if isinstance(source, str) else {f"{name}.{key}": text for key, text in source.items()}
