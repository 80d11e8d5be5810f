"""From a name in a scene to the part it names, imported only when it is asked for."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from pipeline.core.errors import InputError

#: most names that a hint lists
LISTED = 40


def lookup(package: str, name: str, *, where: str) -> Any:
    """The object that `package` lists under `name` in its NAMES, its module imported now.

    `package` is a family folder whose ``__init__`` holds ``KIND`` (for messages) and ``NAMES``,
    a table from the scene's name to ``"module:object"``.  Raises InputError for an unknown name.
    """
    family = import_module(package)
    names: Mapping[str, str] = family.NAMES
    if name not in names:
        raise InputError(where, f"no {family.KIND} is called '{name}'", suggestion(name, names))
    module, _, attribute = names[name].partition(":")
    return getattr(import_module(f"{package}.{module}"), attribute)


def module_of(package: str, name: str, table: str = "NAMES") -> str:
    """Full name of the module that a family's table lists under `name`, without importing it."""
    return f"{package}.{getattr(import_module(package), table)[name].partition(':')[0]}"


def suggestion(name: str, known: Mapping[str, object] | list[str]) -> str:
    """'did you mean ...?' for the nearest known name, or a list of those there are."""
    near = difflib.get_close_matches(name, list(known), n=1)
    if near:
        return f"did you mean '{near[0]}'?"
    names = sorted(known)
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return "known: " + ", ".join(names[:LISTED]) + more if names else "there are none"
