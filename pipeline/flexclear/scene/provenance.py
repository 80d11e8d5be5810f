"""Provenance of values: the texts in `source` of scenes and recipes, by key path; and tables without them."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
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


#: level of optimisation from which Python strips docstrings (`python -OO`)
STRIPPED = 2
_SOURCE = re.compile(r"^\s*Sources?:\s+(.+?)(?:\n\s*\n|\Z)", re.DOTALL | re.MULTILINE)


def cited_sources(docstring: str | None) -> list[str]:
    r"""Return the sources that a docstring names, each on one line.

    >>> cited_sources("A law.\n\nSource: Hertz (1881), Journal f. Math.\n92, 156-171.")
    ['Hertz (1881), Journal f. Math. 92, 156-171.']
    """
    return [" ".join(match[1].split()) for match in _SOURCE.finditer(docstring or "")]


def docstring(thing: Any) -> str | None:
    """Return the docstring of a module, class or function, from its source file where Python strips docstrings.

    The content of results, such as references, must not depend on the interpreter's options.
    """
    if sys.flags.optimize < STRIPPED:
        return getattr(thing, "__doc__", None)
    module = sys.modules.get(getattr(thing, "__module__", None) or thing.__name__)
    path = getattr(module, "__file__", None)
    name = "" if module is thing else getattr(thing, "__qualname__", getattr(thing, "__name__", None))
    return _docstrings_of(path).get(name) if path and path.endswith(".py") and name is not None else None


@cache
def _docstrings_of(path: str) -> dict[str, str | None]:
    """Return the docstrings of a source file by qualified name; the module has the empty name."""
    with open(path, encoding="utf-8") as file:
        tree = ast.parse(file.read())
    return dict(_docstrings(tree, ""))


def _docstrings(node: ast.Module | ast.ClassDef | ast.FunctionDef, name: str) -> list[tuple[str, str | None]]:
    pairs = [(name, ast.get_docstring(node))]
    for inner in node.body:
        if isinstance(inner, (ast.ClassDef, ast.FunctionDef)):
            pairs += _docstrings(inner, f"{name}.{inner.name}" if name else inner.name)
    return pairs
