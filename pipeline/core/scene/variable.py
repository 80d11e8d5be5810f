"""A variable of an artifact, as the contract describes it."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of an artifact. `optional` ones are absent where the scene has no such part.

    units: as UDUNITS reads them; empty for words.  turning: units of entries that turn instead of sliding, where a
    dimension has both.  gaps: whether entries may be NaN, where there is nothing.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    optional: bool = False
    turning: str = ""
    gaps: bool = False


Schema = dict[str, Variable]


def table(text: str) -> Schema:
    """Variables by name, one in each line: ``name | dimensions | units | long name``.

    Behind the name ``?`` marks what is optional and ``~`` what may have gaps; ``units, units`` are those of entries
    that slide and of those that turn. An indented line continues the long name of the line before.
    """
    variables = {}
    for line in re.sub(r"\n +", " ", text.strip()).splitlines():
        name, dims, units, long_name = (part.strip() for part in line.split("|", 3))
        sliding, _, turning = units.partition(", ")
        variables[name.rstrip("?~")] = Variable(
            tuple(dims.split()), sliding, long_name, "?" in name, turning, gaps="~" in name
        )
    return variables
