"""Sources: of values, from `source` in scenes and recipes, by key path; of methods, from docstrings (``Source:``)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any


def sources(table: Mapping[str, Any], path: str = "") -> dict[str, str]:
    """Return key path -> text of every `source` at and below a table; a text is at the path of its table or key."""
    sources: dict[str, str] = {}
    for where, source in _sources(table, path):
        sources |= (
            {where: source} if isinstance(source, str) else {_path_below(where, key): t for key, t in source.items()}
        )
    return sources


def path_of_wrong_source(table: Mapping[str, Any]) -> str | None:
    """Return the path of the first `source` that is no text and no table of texts; None in validated tables."""
    for where, source in _sources(table, ""):
        texts = source.values() if isinstance(source, dict) else [source]
        if not all(isinstance(text, str) for text in texts):
            return _path_below(where, "source")
    return None


def _sources(node: Any, where: str) -> Iterator[tuple[str, Any]]:
    """Yield every `source`, with the key path of the part that it describes."""
    if isinstance(node, Mapping):
        if node.get("source") is not None:
            yield where, node["source"]
        items = ((key, value) for key, value in node.items() if key != "source")
    else:
        items = ((number, value) for number, value in enumerate(node))
    for key, value in items:
        if isinstance(value, (dict, list, tuple)):  # most entries of lists are numbers
            yield from _sources(value, _path_below(where, str(key)))


def _path_below(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def assumed_values(sources: dict[str, str]) -> dict[str, str]:
    """Return the sources of the form ``assumed: why``."""
    return {where: text for where, text in sources.items() if text.startswith("assumed")}


def without_sources(node: Any) -> Any:
    """Return a table without its sources, and without the file names of laws whose numbers have been read."""
    if isinstance(node, dict):
        read = node.get("type") == "table" and "points" in node
        return {k: "" if read and k == "file" else without_sources(v) for k, v in node.items() if k != "source"}
    # most lists contain only numbers
    nested = isinstance(node, list) and any(isinstance(item, (dict, list)) for item in node)
    return [without_sources(item) for item in node] if nested else node


_SOURCE = re.compile(r"^\s*Sources?:\s+(.+?)(?:\n\s*\n|\Z)", re.DOTALL | re.MULTILINE)


def cited_sources(docstring: str | None) -> list[str]:
    r"""Return the sources that a docstring names, each on one line.

    >>> cited_sources("A law.\n\nSource: Hertz (1881), Journal f. Math.\n92, 156-171.")
    ['Hertz (1881), Journal f. Math. 92, 156-171.']
    """
    return [" ".join(match[1].split()) for match in _SOURCE.finditer(docstring or "")]
