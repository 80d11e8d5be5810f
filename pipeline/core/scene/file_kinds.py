"""What a TOML file is: a scene, a sweep of one, or a mesh recipe; another kind than requested is refused with a way
on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.system.errors import InputError

SCENE, SWEEP, RECIPE = "a scene", "a sweep of a scene", "a mesh recipe"
#: keys that only files of a kind have
TELLING = {
    SCENE: {"body", "joint", "extends", "time"},
    SWEEP: {"vary", "keep", "scene"},
    RECIPE: {"shape", "material", "section", "interfaces", "elements"},
}
#: what each kind is for, after its path
USE = {
    SCENE: "flexclear run {path}",
    SWEEP: "flexclear sweep {path}",
    RECIPE: 'flexclear check {path} looks at it; bodies of scenes name it: mesh = "{path}"',
}


def kind_of_file(table: Mapping[str, Any]) -> str:
    """SCENE, SWEEP or RECIPE: the kind that most of a file's keys belong to; SCENE where none decides."""
    matches = {kind: len(keys & set(table)) for kind, keys in TELLING.items()}
    return max(matches, key=lambda kind: matches[kind])


def require_kind(table: Mapping[str, Any], path: Path, requested: str) -> None:
    """InputError when the table in a file is of another kind than requested."""
    kind = kind_of_file(table)
    if kind != requested and (kind != SCENE or TELLING[SCENE] & set(table)):
        raise InputError(str(path), f"is {kind}, not {requested}", USE[kind].format(path=path))
