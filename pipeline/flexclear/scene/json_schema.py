"""JSON schemas of scene files, for editors that complete and check while one types.

A file may contain less than a whole scene: with `extends` it contains only differences, and under `set` parts may be
incomplete. Numbers may be text with a unit; the loader checks which unit fits.
"""

from __future__ import annotations

import copy
from typing import Any

from flexclear.scene.load import FAMILIES, SETTINGS
from flexclear.scene.schema import Scene
from flexclear.scene.sweep import Sweep

DIALECT = "https://json-schema.org/draft/2020-12/schema"
#: prefix of the definitions of incomplete parts
PARTIAL = "Partial"


def scene_schema() -> dict[str, Any]:
    """Return the schema of a scene file, including the keys by which it edits another."""
    schema = Scene.model_json_schema(mode="validation")
    definitions, properties = schema["$defs"], schema["properties"]
    required = schema.pop("required")
    definitions["Accuracy"] = _accuracy(definitions["Accuracy"])
    for name in list(definitions):
        definitions[PARTIAL + name] = _partial(definitions[name])
    properties["extends"] = {"type": "string", "description": "scene file that this one edits, relative to it"}
    properties["replace"] = _edit("parts that replace others completely", properties)
    properties["set"] = _edit("keys of parts and settings to change; all others are unchanged", properties, SETTINGS)
    properties["set"]["properties"] = {k: _partial(p) for k, p in properties["set"]["properties"].items()}
    properties["remove"] = {
        "type": "array",
        "items": {"type": "string"},
        "description": 'paths to remove, such as "joint.A1"',
    }
    schema |= {
        "if": {"not": {"required": ["extends"]}},
        "then": {"required": required, **{"properties": dict.fromkeys(("replace", "set", "remove"), False)}},
    }
    return with_identity(schema, "scene")


def sweep_schema() -> dict[str, Any]:
    """Return the schema of a sweep file; the values of a parameter may be a list without a key."""
    schema = Sweep.model_json_schema(mode="validation", by_alias=True)
    vary = schema["properties"]["vary"]
    vary["additionalProperties"] = {"anyOf": [vary["additionalProperties"], {"type": "array", "minItems": 1}]}
    return with_identity(schema, "sweep")


def with_identity(schema: dict[str, Any], kind: str) -> dict[str, Any]:
    """Return the schema with its dialect and name."""
    return {"$schema": DIALECT, "$id": f"urn:flexclear:schema:{kind}", **schema}


def _edit(text: str, properties: dict[str, Any], more: tuple[str, ...] = ()) -> dict[str, Any]:
    known = {name: copy.deepcopy(properties[name]) for name in (*FAMILIES, *more)}
    return {"type": "object", "description": text, "properties": known, "additionalProperties": False}


def _accuracy(flat: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of `[accuracy]` in files: quantities directly, nested or quoted, not below `quantities`."""
    value = {"type": ["number", "string", "object"], "description": '"1 um", "0.1 %", or { relative = 1e-6 }'}
    settings = {name: flat["properties"][name] for name in ("source", "allow_missed")}
    description = flat.get("description", "")
    return {"type": "object", "description": description, "properties": settings, "additionalProperties": value}


def _partial(node: Any) -> Any:
    """Return a schema with nothing required, also in the parts below."""
    if isinstance(node, list):
        return [_partial(item) for item in node]
    if not isinstance(node, dict):
        return node
    result = {}
    for key, value in node.items():
        if key in ("required", "discriminator", "minProperties"):
            continue
        if key == "oneOf":  # without the required keys that distinguish them, several may fit
            key = "anyOf"
        result[key] = value.replace("#/$defs/", f"#/$defs/{PARTIAL}") if key == "$ref" else _partial(value)
    return result
