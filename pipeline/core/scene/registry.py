"""From a name in a scene to the part it names, imported only when it is asked for.

A family folder's ``__init__`` holds ``KIND`` (for messages) and ``NAMES``, a table from the scene's name to the part:
``"module"``, or ``"module:object"`` where a module holds more than the part; a module in a folder next to the family's
begins with a dot. It imports none of its modules. Where a scene's models (`pipeline.core.scene`) name the parts of a
family already, the table is made from them by `declared`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, get_args

from flexclear.pipeline.core.system.errors import InputError

#: most names that a hint lists
LISTED_NAMES = 40
#: longer names are compared with none
LONGEST_NAME = 100

#: what books and other programs say, the name here that is meant (the first of them that is known), and what to write
ELSEWHERE = (
    (("hinge", "pin", "rotational"), "revolute", ""),
    (("slider", "slide", "translational"), "prismatic", ""),
    (("ball", "ball-joint"), "spherical", ""),
    (("weld", "rigid-joint"), "fixed", ""),
    (("cardan", "hooke"), "universal", ""),
    (("spring", "damper"), "spring-damper", "it is between two points, 'joint-spring' along a joint"),
    (("force", "torque"), "law", "a drive prescribes a motion; a force along a joint is a load of type 'joint-force'"),
    (("motor", "torque"), "joint-force", "it is along a joint; what prescribes a motion is a drive"),
    (
        ("constant-speed", "constant-velocity", "speed", "velocity", "ramp", "linear"),
        "polynomial",
        "a constant speed is { type = 'polynomial', coefficients = [0, '60 rpm'] }",
    ),
    (("sine", "sin", "cosine", "sinusoidal"), "harmonic", ""),
    (("mu", "coefficient"), "dynamic", ""),
    (("frames",), "mesh", "frames of a flexible body are in its recipe"),
    (("mass", "inertia", "com", "density"), "mesh", "of a flexible body they follow from its recipe"),
)


def listed(package: str, name: str, *, where: str) -> tuple[str, str]:
    """Full name of the module, and object there or nothing, that a family lists under `name`; neither is imported.

    Raises InputError, placed at `where`, for a name that the family does not have.
    """
    family = sys.modules.get(package) or import_module(package)  # every command asks thousands of times
    names: Mapping[str, str] = family.NAMES
    if name not in names:
        raise InputError(where, f"no {family.KIND} is called '{name}'", suggestion(name, names))
    module, _, attribute = names[name].partition(":")
    return f"{package.rpartition('.')[0]}{module}" if module[0] == "." else f"{package}.{module}", attribute


def module_of(package: str, name: str, *, where: str = "") -> str:
    """Full name of the module that a family lists under `name`, which is not imported; InputError as of `listed`."""
    return listed(package, name, where=where)[0]


def lookup(package: str, name: str, *, where: str) -> Any:
    """The module or object that a family lists under `name`, imported now; InputError for others."""
    module, attribute = listed(package, name, where=where)
    part = import_module(module)
    return getattr(part, attribute) if attribute else part


def declared(models: Iterable[Any], key: str = "type", made: str = "") -> dict[str, str]:
    """The table of a family whose parts a scene's models declare: 'point-force' is the module `point_force`.

    made: name of the object there that is the part.  key: field of the models that holds the name.
    """
    names = [name for model in models for name in get_args(model.model_fields[key].annotation)]
    return {name: f"{module_name(name)}:{made}".rstrip(":") for name in names}


def module_name(name: str) -> str:
    """Module of a part that a scene calls `name`."""
    return name.replace("-", "_")


def suggestion(name: str, known: Mapping[str, object] | list[str]) -> str:
    """'did you mean ...?' for the name that is meant, or the nearest one, or a list of those there are."""
    for words, meant, advice in ELSEWHERE:
        if name in words and meant in known:
            return f"did you mean '{meant}'?" + (f" {advice}" if advice else "")
    import difflib  # here, since a right name needs none

    # the comparison takes the product of both lengths
    matches = difflib.get_close_matches(name, list(known), n=1) if len(name) <= LONGEST_NAME else []
    if matches:
        return f"did you mean '{matches[0]}'?"
    names = sorted(known)
    more = f" and {len(names) - LISTED_NAMES} more" if len(names) > LISTED_NAMES else ""
    return "known: " + ", ".join(names[:LISTED_NAMES]) + more if names else "there are none"
