"""Each kernel is written once: what stands twice is compiled twice, and mended once."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path


def _kernels(source: str) -> list[tuple[str, str]]:
    """Name and what it says (arguments and statements, without its text) of each kernel in a module's source.

    One that does nothing also counts by its name: in different places nothing has different reasons.
    """
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef) or not any(ast.unparse(d) == "kernel" for d in node.decorator_list):
            continue
        begin = 1 if ast.get_docstring(node) is not None else 0
        body = "\n".join(map(ast.unparse, node.body[begin:]))
        found.append((node.name, f"({ast.unparse(node.args)}) {body or node.name}"))
    return found


def test_no_kernel_stands_twice(root: Path) -> None:
    places = defaultdict(list)
    for path in sorted((root / "pipeline" / "dynamics").rglob("*.py")):
        for name, says in _kernels(path.read_text(encoding="utf-8")):
            places[says].append(f"{path.relative_to(root)}: {name}")
    assert len(places) > 400  # there are some five hundred
    assert {says: where for says, where in places.items() if len(where) > 1} == {}
