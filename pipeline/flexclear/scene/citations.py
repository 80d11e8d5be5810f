"""Sources of methods, from the paragraphs of docstrings that begin with ``Source:``."""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from typing import Any

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
