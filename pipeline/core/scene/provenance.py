"""Where values come from: what scenes and recipes say of that in `source`, reported by path, or left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def sources(table: Mapping[str, Any], path: str = "") -> dict[str, str]:
    """Place -> text of every `source` at and below a table; of the table itself by its path, or by that of its key."""
    sources: dict[str, str] = {}
    for where, source in _sources(table, path):
        sources |= {where: source} if isinstance(source, str) else {_below(where, key): t for key, t in source.items()}
    return sources


def mistaken(table: Mapping[str, Any]) -> str | None:
    """Place of the first `source` that is neither a text nor a table of texts; where models were read there is none."""
    for where, source in _sources(table, ""):
        texts = source.values() if isinstance(source, dict) else [source]
        if not all(isinstance(text, str) for text in texts):
            return _below(where, "source")
    return None


def _sources(node: Any, where: str) -> Iterator[tuple[str, Any]]:
    """Every `source` that is there, with the path of what it is about."""
    if isinstance(node, Mapping):
        if node.get("source") is not None:
            yield where, node["source"]
        items = ((key, value) for key, value in node.items() if key != "source")
    else:
        items = ((number, value) for number, value in enumerate(node))
    for key, value in items:
        if isinstance(value, (dict, list, tuple)):  # most lists are of numbers
            yield from _sources(value, _below(where, str(key)))


def _below(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def assumed(sources: dict[str, str]) -> dict[str, str]:
    """Those that say ``assumed: why``."""
    return {where: text for where, text in sources.items() if text.startswith("assumed")}


def without(node: Any) -> Any:
    """A table without its sources, and without the names of files that laws were read from, whose numbers are there."""
    if isinstance(node, dict):
        read = node.get("type") == "table" and "points" in node
        return {k: "" if read and k == "file" else without(v) for k, v in node.items() if k != "source"}
    # most lists are of numbers
    nested = isinstance(node, list) and any(isinstance(item, (dict, list)) for item in node)
    return [without(item) for item in node] if nested else node
