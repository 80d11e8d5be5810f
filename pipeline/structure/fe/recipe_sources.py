"""Where the values of a mesh recipe come from, as its mesh tells it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from flexclear.pipeline.core.scene.fields import Part, Source

#: parts whose sources are told first; the others follow in the order of the model
FIRST = ("shape", "material", "section", "end_section", "inertia_section")


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
