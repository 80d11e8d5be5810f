"""What a load acts on and with, as its module reads it from the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """frames: the frame acted on, or the two between which it acts; or `joint`: that joint's frames.

    laws: law, dimension and path of each.  numbers: as many as it needs.  follows: whether it turns with
    its frame.  counts_turns: whether it needs its angle beyond half a turn.  states: number of internal states.
    kinks: speeds along its joint coordinate at which its slope or curvature jumps, or 0; its kernel keeps the speed in
    LOAD_SPEEDS, and its parameters say by `bends` that steps end there.
    """

    frames: tuple[str, ...] = ()
    joint: str | None = None
    laws: tuple[tuple[Any, str, str], ...] = ()
    numbers: tuple[float, ...] = ()
    follows: bool = False
    counts_turns: bool = False
    states: int = 0
    kinks: tuple[float, float] = (0.0, 0.0)
