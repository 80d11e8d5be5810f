"""Lookup of the code for a name in a scene; modules are imported only at their use.

A family folder's ``__init__`` holds ``KIND`` (for messages) and ``NAMES``, a table from the scene's name to the part:
``"module"``, or ``"module:object"`` where a module holds more than the part; a module in a folder next to the family's
begins with a dot. It imports none of its modules. Where a scene's models (`scene`) name the parts of a
family already, `declared` builds the table from them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, get_args

from flexclear.system.errors import InputError

#: largest number of names in a hint
LISTED_NAMES = 40
#: length above which a name is not compared with others
LONGEST_NAME = 100

#: words of books and other programs, the name for them here (the first known one applies), and advice on what to write
ELSEWHERE = (
    (("hinge", "pin", "rotational"), "revolute", ""),
    (("slider", "slide", "translational"), "prismatic", ""),
    (("ball", "ball-joint"), "spherical", ""),
    (("weld", "rigid-joint"), "fixed", ""),
    (("cardan", "hooke"), "universal", ""),
    (("spring", "damper"), "spring-damper", "it acts between two points; 'joint-spring' acts along a joint"),
    (("force", "torque"), "law", "a drive prescribes a motion; a force along a joint is a load of type 'joint-force'"),
    (("motor", "torque"), "joint-force", "it acts along a joint; a drive prescribes a motion"),
    (
        ("constant-speed", "constant-velocity", "speed", "velocity", "ramp", "linear"),
        "polynomial",
        "a constant speed is { type = 'polynomial', coefficients = [0, '60 rpm'] }",
    ),
    (("sine", "sin", "cosine", "sinusoidal"), "harmonic", ""),
    (("mu", "coefficient"), "dynamic", ""),
    (("frames",), "mesh", "frames of a flexible body are in its recipe"),
    (("mass", "inertia", "com", "density"), "mesh", "those of a flexible body follow from its recipe"),
)


def listed(package: str, name: str, *, where: str) -> tuple[str, str]:
    """Return full module name, and object there or "", of the part that a family lists as `name`, without importing it.

    Raises InputError, placed at `where`, for a name that the family does not have.
    """
    family = sys.modules.get(package) or import_module(package)  # the fast way: commands call this thousands of times
    names: Mapping[str, str] = family.NAMES
    if name not in names:
        raise InputError(where, f"no {family.KIND} is called '{name}'", suggestion(name, names))
    module, _, attribute = names[name].partition(":")
    return f"{package.rpartition('.')[0]}{module}" if module[0] == "." else f"{package}.{module}", attribute


def module_of(package: str, name: str, *, where: str = "") -> str:
    """Return the full module name of the part that a family lists as `name`; raise InputError as `listed` does."""
    return listed(package, name, where=where)[0]


def lookup(package: str, name: str, *, where: str) -> Any:
    """Import and return the module or object that a family lists as `name`; raise InputError for unknown names."""
    module, attribute = listed(package, name, where=where)
    part = import_module(module)
    return getattr(part, attribute) if attribute else part


def declared(models: Iterable[Any], key: str = "type", made: str = "") -> dict[str, str]:
    """Return the table of a family whose parts a scene's models declare: 'point-force' is the module `point_force`.

    made: name of the part's object in the module. key: field of the models that holds the name.
    """
    names = [name for model in models for name in get_args(model.model_fields[key].annotation)]
    return {name: f"{module_name(name)}:{made}".rstrip(":") for name in names}


def module_name(name: str) -> str:
    """Return the module of a part by the part's name in scenes."""
    return name.replace("-", "_")


def suggestion(name: str, known: Mapping[str, object] | list[str]) -> str:
    """Return 'did you mean ...?' for a known synonym or the nearest name, or a list of the known names."""
    for words, meant, advice in ELSEWHERE:
        if name in words and meant in known:
            return f"did you mean '{meant}'?" + (f" {advice}" if advice else "")
    import difflib  # here, since correct names do not need it

    # the time of a comparison grows with the product of both lengths
    matches = difflib.get_close_matches(name, list(known), n=1) if len(name) <= LONGEST_NAME else []
    if matches:
        return f"did you mean '{matches[0]}'?"
    names = sorted(known)
    more = f" and {len(names) - LISTED_NAMES} more" if len(names) > LISTED_NAMES else ""
    return "known: " + ", ".join(names[:LISTED_NAMES]) + more if names else "there are none"
