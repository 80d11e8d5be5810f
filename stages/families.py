"""Which module a name in a scene stands for, read from the family's list without importing anything.

The keys of artifacts need the modules that a scene reaches by name, and a run that finds
everything fresh must not pay for importing solvers.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pipeline
from pipeline.core.errors import InputError
from pipeline.core.registry import suggestion

#: folder that holds the packages; sources are read below it
TREE = Path(pipeline.__file__).parent.parent


def module(package: str, name: str, *, where: str, table: str = "NAMES") -> str:
    """Full name of the module that lists `name` in the family folder `package`.

    Raises InputError, placed at `where`, when the family has no such name.
    """
    family = constants(package)
    names: Mapping[str, str] = family[table]
    if name not in names:
        raise InputError(where, f"no {family['KIND']} is called '{name}'", suggestion(name, names))
    return f"{package}.{names[name].partition(':')[0]}"


@cache
def constants(package: str) -> Mapping[str, Any]:
    """Literal values assigned at the top of a package's ``__init__``."""
    path = TREE.joinpath(*package.split("."), "__init__.py")
    found: dict[str, Any] = {}
    for node in ast.parse(path.read_bytes()).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                found[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                continue
    return found
