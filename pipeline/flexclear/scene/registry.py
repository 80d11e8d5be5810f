"""Lookup of the part for a name in a scene, and hints at the names that are meant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from flexclear.system.errors import InputError

Part = TypeVar("Part")
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
    (("pin-in-slot", "point-on-line", "inline"), "slot", ""),
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


def lookup(table: Mapping[str, Part], name: str, *, kind: str, where: str) -> Part:
    """Return the part that a table lists as `name`; raise InputError, placed at `where`, for an unknown name.

    kind: what the table lists, in words.
    """
    if name not in table:
        raise InputError(where, f"no {kind} is called '{name}'", suggestion(name, table))
    return table[name]


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
