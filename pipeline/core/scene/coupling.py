"""Parts of a scene that nothing couples to what is asked for: they can be left out without any error.

Joints, drives, loads, stops and gears couple the bodies and joints that they name; the fixed world couples nothing, and
gravity acts on each body by itself.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from flexclear.pipeline.core.scene.load import FAMILIES, SETTINGS, edited
from flexclear.pipeline.core.scene.schema import Scene

#: settings that follow the parts: quantities of parts that are gone are no longer asked for or shown
FOLLOWING = ("accuracy", "view", "ensemble")


def uncoupled(scene: Scene, asked: Collection[str]) -> tuple[str, ...]:
    """Places, such as ``body.bob``, of all parts that nothing couples to the parts of the names asked for.

    Empty where a name asked for is none of a part, and where a setting speaks of what could be left out.
    """
    table = scene.model_dump(mode="json", exclude_none=True)
    parts = {f"{family}.{name}": part for family in FAMILIES for name, part in table.get(family, {}).items()}
    moving = [name for name, body in scene.body.items() if body.type != "ground"]
    neighbours: dict[str, set[str]] = {f"body.{name}": set() for name in moving}
    for part_name, part in parts.items():
        if part_name.startswith("body."):
            continue
        stems = {text.partition(".")[0] for text in _texts(part)}
        named = {f"body.{n}" for n in stems & set(moving)} | {f"joint.{n}" for n in stems & set(scene.joint)}
        for other in named - {part_name}:
            neighbours.setdefault(part_name, set()).add(other)
            neighbours.setdefault(other, set()).add(part_name)
    ends = [part_name for part_name in neighbours if part_name.partition(".")[2] in asked]
    if {part_name.partition(".")[2] for part_name in ends} != set(asked):
        return ()
    reached = set(ends)
    while ends:
        new = neighbours[ends.pop()] - reached
        reached |= new
        ends += new
    uncoupled_parts = [part_name for part_name in parts if part_name in neighbours and part_name not in reached]
    names = {part_name.partition(".")[2] for part_name in uncoupled_parts}
    spoken = {text.partition(".")[0] for key in SETTINGS if key not in FOLLOWING for text in _texts(table.get(key))}
    return () if names & spoken else tuple(uncoupled_parts)


def lessened(scene: Scene, removed: Collection[str]) -> Scene:
    """The scene without these parts; the scene itself where there are none."""
    if not removed:
        return scene
    changes: dict[str, Any] = {}
    for family in dict.fromkeys(where.partition(".")[0] for where in removed):
        parts = {n: p.model_dump(mode="json", exclude_none=True) for n, p in getattr(scene, family).items()}
        changes[family] = {n: p for n, p in parts.items() if f"{family}.{n}" not in removed}
    return edited(scene, changes | {key: None for key in FOLLOWING if getattr(scene, key) is not None})


def _texts(value: object) -> Iterator[str]:
    """All texts in a table, and the names of what it lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield str(key)
            yield from _texts(item)
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _texts(item)
