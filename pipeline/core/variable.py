"""A variable of an artifact, as the contract describes it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of an artifact. `optional` ones are absent where the scene has no such part.

    flags: what the values 0, 1, .. of a variable that tells kinds mean.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    optional: bool = False
    flags: tuple[str, ...] = ()


Schema = dict[str, Variable]
