"""Rods that bend far: a flexible body with `segments` becomes as many bodies, joined rigidly end to end.

Each has its own floating frame and modes, so that the rotation of the whole rod is exact, and only what a segment bends
by is small. With n segments the error of a bent rod falls as 1/n^2 (``rod.tip`` of ``rod`` is then a frame of
``rod_8``; the frames between segments are called ``cut_1``, ``cut_2`` ...).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from flexclear.scene.toml_files import read_toml, recipe_frames
from flexclear.scene.units import quantity
from flexclear.system.errors import InputError

#: positions along a rod that differ by less than this fraction of its length are equal; they come from decimal text
SAME_PLACE = 1e-9
#: numbers of segments
FEWEST, MOST = 2, 200
#: families of parts that name frames, and the keys that do
FRAMES = ("joint", "load", "drive"), ("between", "frame")
#: settings that list bodies by name
BODIES = (("ensemble", "bodies"), ("sections", "bodies"), ("output", "stress"), ("output", "frame_loads"))
#: recipes that can be cut
RODS = ("straight-beam", "segmented-beam")


def cut_segments(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return a scene's table with segments in the places of the bodies that ask for them.

    Raises InputError, at `where`, for a recipe that is no rod or has too few elements, and for names that are taken.
    """
    result = {family: dict(parts) if isinstance(parts, dict) else parts for family, parts in table.items()}
    bodies = table.get("body")
    for name, body in bodies.items() if isinstance(bodies, dict) else ():
        if isinstance(body, dict) and _to_be_cut(body):
            _cut_body(result, name, body, where)
    return result


def _nonzero(component: object) -> bool:
    return component not in (0, 0.0)


def _to_be_cut(body: Mapping[str, Any]) -> bool:
    """Return False also for a number that the validation of the body refuses, and for a body without modes."""
    count, modes = body.get("segments"), body.get("modes")
    valid = isinstance(count, int) and not isinstance(count, bool) and FEWEST <= count <= MOST
    return valid and isinstance(body.get("mesh"), str) and not (isinstance(modes, dict) and modes.get("count") == 0)


def _cut_body(table: dict[str, Any], name: str, body: Mapping[str, Any], where: str) -> None:
    count, place = body["segments"], f"{where} [body.{name}.segments]"
    try:
        frames = _frames_of(read_toml(Path(body["mesh"])), count)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(place, f"{body['mesh']}: {error}", "give a recipe of a rod with more elements") from None
    if body.get("velocity") is not None and any(map(_nonzero, body.get("angular_velocity") or ())):
        problem = "is that of the centre of mass, which a rod in segments that turns does not have before it is meshed"
        raise InputError(f"{where} [body.{name}.velocity]", problem, "give the start rates of a joint")
    modes = body.get("modes")
    if isinstance(modes, dict) and (modes.get("interfaces") or modes.get("held")):
        rule = "the ends of segments are their interfaces"
        raise InputError(f"{where} [body.{name}.modes]", rule, "leave out modes.interfaces and modes.held")
    names = [f"{name}_{k}" for k in range(1, count + 1)]
    joints = {
        f"{name}_cut_{k}": {"type": "fixed", "between": [f"{one}.cut_{k}", f"{other}.cut_{k}"]}
        for k, (one, other) in enumerate(pairwise(names), start=1)
    }
    bodies, others = table["body"], table.setdefault("joint", {})
    for taken in [*(bodies.keys() & set(names)), *(others.keys() & joints.keys())]:
        raise InputError(place, f"a part is called '{taken}' already, as one of its segments", "rename that part")
    shared = {key: value for key, value in body.items() if key not in ("segments", "geometry")}
    first = {"geometry": body["geometry"]} if "geometry" in body else {}
    pieces = {n: shared | {"segment": [k, count]} | (first if k == 1 else {}) for k, n in enumerate(names, start=1)}
    table["body"] = {
        key: part
        for old, part_of_old in bodies.items()
        for key, part in (pieces.items() if old == name else ((old, part_of_old),))
    }
    host = {
        f"{name}.{frame}": f"{n}.{frame}" for n, own in reversed([*zip(names, frames, strict=True)]) for frame in own
    }
    for family in FRAMES[0]:
        if isinstance(parts := table.get(family), dict):
            table[family] = {key: _with_host_frames(part, host) for key, part in parts.items()}
    table["joint"] |= joints
    for family, key in BODIES:
        listed = table.get(family, {}).get(key) if isinstance(table.get(family), dict) else None
        if isinstance(listed, list | tuple):
            every = [n for one in listed for n in (names if one == name else [one])]
            table[family] = {**table[family], key: every}


def _with_host_frames(part: Any, host: Mapping[str, str]) -> Any:
    if not isinstance(part, dict):
        return part
    return {key: _frames(value, host) if key in FRAMES[1] else value for key, value in part.items()}


def _frames(value: Any, host: Mapping[str, str]) -> Any:
    if isinstance(value, list | tuple):
        return [_frames(one, host) for one in value]
    return host.get(value, value) if isinstance(value, str) else value


def body_frames(mesh: str, segment: Sequence[int] | None = None) -> list[str] | None:
    """Return the names of the frames of a recipe, or of one segment of its rod: ``(k, n)`` is the k-th of n.

    None when they cannot be determined, which is reported elsewhere.
    """
    if segment is None:
        return recipe_frames(mesh)
    try:
        status = Path(mesh).stat()
        return _frames_of_recipe(mesh, segment[1], status.st_mtime_ns, status.st_size)[segment[0] - 1]
    except (OSError, ValueError, KeyError, TypeError, InputError):
        return None


@lru_cache
def _frames_of_recipe(mesh: str, count: int, changed: int, size: int) -> list[list[str]]:
    return _frames_of(read_toml(Path(mesh)), count)


def _frames_of(recipe: Mapping[str, Any], count: int) -> list[list[str]]:
    """Return the frames on each segment, those at its cut ends included; ValueError if the recipe cannot be cut so."""
    x = list(_nodes(recipe))
    at, close = [x[node] for node in nodes_of_cuts(x, count)], SAME_PLACE * (x[-1] - x[0])
    places = {name: quantity(frame["x"], "length") for name, frame in recipe["frames"].items()}
    for taken in places.keys() & {f"cut_{k}" for k in range(1, count)}:
        raise ValueError(f"its frame '{taken}' has the name of an end of a segment")
    return [
        [name for name, x in places.items() if start - close <= x <= end + close] + cut_names((k, count))
        for k, (start, end) in enumerate(pairwise(at), start=1)
    ]


def cut_names(segment: Sequence[int]) -> list[str]:
    """Return the names of the frames at the cut ends of a segment, the one at its start first."""
    k, count = segment
    return [f"cut_{end}" for end in (k - 1, k) if 0 < end < count]


def nodes_of_cuts(x: Sequence[float], count: int) -> list[int]:
    """Return the nodes, of those at `x` along a rod [m], that are nearest to the ends of `count` equal segments.

    Raises ValueError where two ends have the same node.
    """
    nodes = []
    for k in range(count + 1):
        place = x[0] + (x[-1] - x[0]) * k / count
        after = min(max(bisect_left(x, place), 1), len(x) - 1)
        nodes.append(after if x[after] - place <= place - x[after - 1] else after - 1)
    if len(set(nodes)) <= count:
        raise ValueError(f"its {len(x) - 1} elements cannot be cut into {count} segments of nearly equal lengths")
    return nodes


def _nodes(recipe: Mapping[str, Any]) -> Iterator[float]:
    """Yield the positions of the nodes along the rod of a recipe [m]; ValueError where it has none."""
    shape = recipe.get("shape")
    kind = shape.get("type") if isinstance(shape, dict) else None
    if not isinstance(shape, dict) or kind not in RODS:
        raise ValueError(f"only rods can be cut, not the shape '{kind}'")
    whole: dict[str, Any] = {"start": 0.0, "end": shape.get("length"), "elements": recipe.get("elements")}
    pieces = shape.get("segments", ()) if kind == RODS[1] else [whole]
    yield 0.0
    for piece in pieces:
        start, end, count = quantity(piece["start"], "length"), quantity(piece["end"], "length"), piece["elements"]
        yield from (start + (end - start) * (k + 1) / count for k in range(count))
