"""A variable of an artifact, as the contract describes it."""

from __future__ import annotations

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
