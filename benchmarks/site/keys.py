"""Pages of docs/reference: every key of scenes, mesh recipes and sweeps, from the schemas that validate the files."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import TypeAdapter

from flexclear.artifacts.paths import PROJECT
from flexclear.scene.schema import Scene
from flexclear.scene.sweep import Sweep
from flexclear.structure.fe.recipe import Recipe

#: unit of a number without unit, by quantity
SI = {
    "length": "m",
    "time": "s",
    "mass": "kg",
    "angle": "rad",
    "velocity": "m/s",
    "force": "N",
    "angular velocity": "rad/s",
    "acceleration": "m/s^2",
    "stiffness": "N/m",
    "damping": "N s/m",
    "pressure": "Pa",
    "viscosity": "Pa s",
    "density": "kg/m^3",
    "area": "m^2",
    "second moment of area": "m^4",
}
#: a value that allows all of these classes allows any law of time
_LAW_KINDS = {"Constant", "Step", "Harmonic"}
#: headings of classes whose names are not made of words
_NAMES = {"LuGre": "LuGre", "Pid": "PID", "SampledPid": "Sampled PID"}
#: name of a JSON schema definition where two modules have a class of the same name
_MODULE = re.compile(r"^flexclear__.*__(\w+?)__(?:recipe|beam_recipe)__(\w+)$|^flexclear__.*__(\w+)$")
HEADS = {
    "scene": (
        "Keys of a scene",
        'A scene is a TOML file. Numbers are SI, or text with a unit (`"20.5 mm"`). A law of time may be a bare '
        "constant. Every part may say where its values come from in `source`, either one text or one per key.",
    ),
    "recipe": (
        "Keys of a mesh recipe",
        "A recipe is a TOML file that a flexible body names as its `mesh`. Which keys it has depends on `shape.type`.",
    ),
    "sweep": (
        "Keys of a sweep",
        "A TOML file for `flexclear sweep`; [sweeps](../sweeps.md) shows how to use it.",
    ),
}
WHERE = "Files are checked against what this page is written from (`python -m benchmarks.site`).\n\n"
EDITS = """## Edits of another file

- `extends`: scene file that this one edits, relative to it
- `[replace.<family>.<name>]`: a part that replaces the old one completely
- `[set.<family>.<name>]`: keys to change; all others are unchanged
- `remove`: list of paths to remove, such as `"joint.A1"`

"""
#: key, value with default, meaning
Row = tuple[str, str, str]
#: sections from which on a common row appears once, in a list of its own
SEVERAL = 3
#: longest default and example that the page shows [characters]
LONGEST, LONGEST_EXAMPLE = 60, 350
SHARED = """## Keys of several parts

The sections below name these keys without repeating them.

"""


def page(kind: str) -> str:
    """Return the page of the keys of scenes, recipes or sweeps."""
    found = _schema(kind)
    definitions = found.pop("$defs", {})
    title, text = HEADS[kind]
    parts = [f"# {title}\n\n{text} {WHERE}"]
    if "properties" in found:
        parts.append(f"{_list(_rows(found, definitions))}\n\n")
    parts += [EDITS] if kind == "scene" else []
    examples, rows = (
        _examples(kind),
        {name: _rows(definitions[name], definitions) for name in _order(found, definitions)},
    )
    shared = _shared(row for of in rows.values() for row in of)
    parts += [f"{SHARED}{_list(shared.values())}\n\n"] if shared else []
    for name in rows:
        parts.append(_section(name, definitions, examples, rows, shared))
    return "".join(parts).rstrip() + "\n"


def _shared(rows: Iterable[Row]) -> dict[str, Row]:
    """Return each row that stands in several sections, by key, the most frequent one of its key."""
    counted = sorted(Counter(rows).items(), key=lambda one: (one[0][0], one[1]))
    return {row[0]: row for row, times in counted if times >= SEVERAL}


def _schema(kind: str) -> dict[str, Any]:
    if kind == "recipe":
        adapter: TypeAdapter[Any] = TypeAdapter(Recipe)
        return adapter.json_schema()
    return (Scene if kind == "scene" else Sweep).model_json_schema()


def _order(schema: Any, definitions: dict[str, Any]) -> list[str]:
    """Return the names of definitions in the order in which they are first referenced from the top."""
    waiting, found = [schema], dict[str, None]()
    while waiting:
        for name in _references(waiting.pop(0)):
            if name not in found:
                found[name] = None
                waiting.append(definitions[name])
    return list(found)


def _references(node: Any) -> Iterator[str]:
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "$ref":
                yield value.rpartition("/")[2]
            elif key != "discriminator":
                yield from _references(value)
    elif isinstance(node, list):
        for item in node:
            yield from _references(item)


def _section(
    name: str, definitions: dict[str, Any], examples: dict[str, str], rows: dict[str, list[Row]], shared: dict[str, Row]
) -> str:
    part = definitions[name]
    entry = str(part.get("description", "")).partition("\n\n")[0].replace("\n", " ")
    base = _base(name, rows)
    more = [row for row in rows[name] if base is None or row not in rows[base]]
    own = [row for row in more if shared.get(row[0]) != row]
    known = ", ".join(row[0] for row in more if row not in own)
    # of two parts of one kind with these keys, the first has it
    fits = set(re.findall(r"^(\w+) =", examples.get(_kind(part), ""), re.M)) <= set(part.get("properties", {}))
    example = examples.pop(_kind(part), "") if fits else ""
    texts = [f"## {_heading(name, part)}", entry]
    texts += [f"All keys of [{_heading(base, definitions[base])}](#{_anchor(base, definitions)})."] if base else []
    texts += [_list(own)] if own else []
    texts += [f"[Also](#keys-of-several-parts) {known}."] if known else []
    texts += [f"```toml\n{example}\n```"] if example else []
    return "\n\n".join(texts) + "\n\n"


def _base(name: str, rows: dict[str, list[Row]]) -> str | None:
    """Return the largest other part, of several keys, all of which this part has as well, or None."""
    inner = [other for other, of in rows.items() if len(of) >= SEVERAL and set(of) < set(rows[name])]
    return max(inner, key=lambda other: len(rows[other]), default=None)


def _heading(name: str, part: dict[str, Any]) -> str:
    found = _MODULE.match(name)
    plain = (f"{found[2]} of {found[1]}" if found[2] else found[3]) if found else name
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    entry = _NAMES.get(plain, f"{words[0]}{words[1:].lower()}")
    return f"{entry} (`{_kind(part)}`)" if _kind(part) else entry


def _kind(part: dict[str, Any]) -> str:
    """Return the constant `type`, `law` or `integrator` that distinguishes a part within its family, or no text."""
    for key in ("type", "law", "integrator"):
        entry = part.get("properties", {}).get(key, {})
        if "const" in entry:
            return str(entry["const"])
    return ""


def _anchor(name: str, definitions: dict[str, Any]) -> str:
    words = re.sub(r"[^\w\- ]", "", _heading(name, definitions[name]).lower())
    return words.replace(" ", "-")


def _list(rows: Iterable[Row]) -> str:
    return "\n".join(f"- {key} ({value}): {meaning}" for key, value, meaning in rows)


def _rows(part: dict[str, Any], definitions: dict[str, Any]) -> list[Row]:
    """Return the rows of a part, without its kind, which its heading names, and without `source`, which all have."""
    needed = part.get("required", [])
    return [
        (f"`{key}`", f"{_value(entry, definitions)}{'; needed' if key in needed else _default(entry)}", _meaning(entry))
        for key, entry in part.get("properties", {}).items()
        if key != "source" and "const" not in entry
    ]


def _default(entry: dict[str, Any]) -> str:
    value = entry.get("default")
    if value in (None, {}, [], "") or isinstance(value, dict):
        return ""
    return f"; default `{json.dumps(value)}`" if len(json.dumps(value)) < LONGEST else "; default zeros"


def _meaning(entry: dict[str, Any]) -> str:
    return " ".join(str(entry.get("description", "")).split())


def _value(entry: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Return the permitted values of an entry in words."""
    if "enum" in entry:
        return ", ".join(f"`{json.dumps(one)}`" for one in entry["enum"])
    if "$ref" in entry:
        name = entry["$ref"].rpartition("/")[2]
        shown = f"`{kind}`" if (kind := _kind(definitions[name])) else _heading(name, definitions[name])
        return f"[{shown}](#{_anchor(name, definitions)})"
    for several in ("anyOf", "oneOf"):
        if several in entry:
            kinds = [_value(one, definitions) for one in entry[several] if one.get("type") != "null"]
            if set(_references(entry)) >= _LAW_KINDS and len(kinds) > 1:
                return f"[law of time](#{_anchor('Constant', definitions)})"
            return ", ".join(dict.fromkeys(kinds))
    if "format" in entry:
        return _with_unit(entry["format"])
    return _plain(entry, definitions)


def _with_unit(quantity: str) -> str:
    """Return the SI unit of a quantity's bare numbers, or the quantity."""
    return SI.get(quantity, quantity)


def _plain(entry: dict[str, Any], definitions: dict[str, Any]) -> str:
    kind = entry.get("type")
    if kind == "array":
        inner = entry.get("items") or (entry.get("prefixItems") or [{}])[0]
        if "format" in inner and entry.get("maxItems") == 3:
            return f"3 x {_with_unit(inner['format'])}"
        return f"list of {_value(inner, definitions)}" if inner else "list"
    if kind == "object":
        inner = entry.get("additionalProperties")
        return f"by name: {_value(inner, definitions)}" if isinstance(inner, dict) and inner else "table"
    words = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true or false"}
    if isinstance(kind, list):
        return "number with unit"
    return words.get(str(kind), "any value")


def _examples(kind: str) -> dict[str, str]:
    """Return the shortest example of each kind of part among the scenes or recipes of this project, as TOML."""
    found: dict[str, str] = {}
    folders = {"scene": ("scenes",), "recipe": ("meshes", "scenes"), "sweep": ("scenes/sweeps",)}[kind]
    for path in sorted(path for folder in folders for path in (PROJECT / folder).rglob("*.toml")):
        for place, part in _parts(tomllib.loads(path.read_text(encoding="utf-8"))):
            name = next((part[key] for key in ("type", "law", "integrator") if isinstance(part.get(key), str)), "")
            text = _toml(place, part)
            if name and place and (name not in found or len(text) < len(found[name])):
                found[name] = text
    return {name: text for name, text in found.items() if len(text) < LONGEST_EXAMPLE}


def _parts(node: Any, place: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    if not isinstance(node, dict):
        return
    if place:
        yield place, node
    for key, value in node.items():
        if key not in ("replace", "set") and not (place and "." in place and key == "source"):
            yield from _parts(value, f"{place}.{key}" if place else key)


def _toml(place: str, part: dict[str, Any]) -> str:
    lines = [f"{key} = {_inline(value)}" for key, value in part.items() if key != "source"]
    return "\n".join([f"[{place}]", *lines])


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        pairs = (f"{key} = {_inline(inner)}" for key, inner in value.items() if key != "source")
        return "{ " + ", ".join(pairs) + " }" if value else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(_inline(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False)
