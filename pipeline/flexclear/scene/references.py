"""Names in a scene of frames, bodies and joints that do not exist, reported before the work starts.

The plain table is examined, so that a scene with other errors is checked, too.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from flexclear.scene.load import is_file
from flexclear.scene.registry import suggestion
from flexclear.system.errors import InputError

#: returns the names of the frames in the mesh recipe of this path, or of a segment of its rod; None where they cannot
#: be determined
Recipe = Callable[[str, Sequence[int] | None], Collection[str] | None]
#: keys of parts that name frames; keys that name joints, alone or in front of a coordinate
FRAMES = (("joint", "between"), ("load", "between"), ("drive", "frame"), ("load", "frame"))
JOINTS = (
    *product(("drive", "load", "stop"), ("joint", "actuators")),
    *product(("gear",), ("first", "second")),
    ("stop", "relative_to"),
)


def dangling_names(table: Mapping[str, Any], recipe: Recipe, path: str) -> list[InputError]:
    """Return an error for every name in a composed scene table that does not exist; `path` opens each location."""
    frames = {name: _frames(body, recipe) for name, body in _tables_of_family(table.get("body"))}
    joints = [name for name, _ in _tables_of_family(table.get("joint"))]
    errors: list[InputError] = []
    for where, name in _references(table, FRAMES):
        errors += _frame_errors(f"{path} [{where}]", name, frames)
    for where, text in _references(table, JOINTS):
        name = text if where.endswith(".joint") else text.partition(".")[0]
        if name not in joints:
            errors.append(InputError(f"{path} [{where}]", f"there is no joint '{name}'", suggestion(name, joints)))
    ensemble = table.get("ensemble")
    for name in _texts(ensemble.get("bodies")) if isinstance(ensemble, dict) else ():
        if name not in frames:
            errors.append(
                InputError(f"{path} [ensemble.bodies]", f"there is no body '{name}'", suggestion(name, frames))
            )
    for name, body in _tables_of_family(table.get("body")):
        errors += _interface_errors(f"{path} [body.{name}.modes", body, frames[name])
        errors += _files(f"{path} [body.{name}.geometry", body)
    return errors


def _tables_of_family(family: object) -> Iterator[tuple[str, dict[str, Any]]]:
    if isinstance(family, dict):
        yield from ((name, part) for name, part in family.items() if isinstance(part, dict))


def _frames(body: Mapping[str, Any], recipe: Recipe) -> Collection[str] | None:
    """Return the names of a body's frames; None where another error, reported elsewhere, hides them."""
    if isinstance(body.get("mesh"), str):
        return recipe(body["mesh"], body.get("segment"))
    frames = body.get("frames", {})
    return list(frames) if isinstance(frames, dict) else None


def _frame_errors(where: str, name: str, frames: Mapping[str, Collection[str] | None]) -> list[InputError]:
    body, _, frame = name.partition(".")
    if not frame:
        return []  # validation reports a frame without its body
    if body not in frames:
        return [InputError(where, f"'{name}': there is no body '{body}'", suggestion(body, frames))]
    known = frames[body]
    if known is None or frame in known:
        return []
    return [InputError(where, f"'{name}': body '{body}' has no frame '{frame}'", suggestion(frame, list(known)))]


def _interface_errors(where: str, body: Mapping[str, Any], frames: Collection[str] | None) -> list[InputError]:
    modes = body.get("modes")
    if frames is None or not isinstance(modes, dict):
        return []
    named = [("interfaces", name) for name in _texts(modes.get("interfaces"))]
    named += [("held", name.partition(".")[0]) for name in _texts(modes.get("held"))]
    return [
        InputError(f"{where}.{key}]", f"the recipe has no frame '{name}'", suggestion(name, list(frames)))
        for key, name in named
        if name not in frames
    ]


def _files(where: str, body: Mapping[str, Any]) -> Iterator[InputError]:
    """Yield an error for every file of a body's shapes that does not exist."""
    shapes = body.get("geometry")
    for k, shape in enumerate(shapes if isinstance(shapes, (list, tuple)) else ()):
        file = shape.get("file") if isinstance(shape, dict) else None
        if isinstance(file, str) and not is_file(Path(file)):
            yield InputError(f"{where}.{k}]", f"there is no file {file}", "paths are relative to the scene")


def _texts(value: object) -> list[str]:
    values = value if isinstance(value, (list, tuple)) else [value]
    return [name for name in values if isinstance(name, str)]


def _references(table: Mapping[str, Any], keys: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    for family, key in keys:
        for name, part in _tables_of_family(table.get(family)):
            yield from ((f"{family}.{name}.{key}", text) for text in _texts(part.get(key)))
