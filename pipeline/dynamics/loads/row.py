"""What a load acts on and with, as its module reads it from the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flexclear.pipeline.core.scene.formulas import Formula
from flexclear.pipeline.core.scene.laws import Polynomial

#: the time itself, as a law
TIME = Polynomial(type="polynomial", coefficients=(0.0, 1.0))


@dataclass(frozen=True)
class Row:
    """frames: the frame acted on, or the two between which it acts; or `joint`: that joint's frames.

    laws: law, dimension and path of each.  numbers: as many as it needs.  follows: whether it turns with
    its frame.  counts_turns: whether it needs its angle beyond half a turn.  states: number of internal states.
    bends: of each number that its kernel keeps in LOAD_BENDS, the magnitudes at which its slope or curvature jumps, as
    speeds; 0.0: where it changes its sign; none: nowhere. Its parameters say by `bends` that steps end there.
    reads: sort and name of what an expression reads (`formulas.Formula`).  located: whether the kernels' origin, from
    which positions are measured, comes before its numbers.
    """

    frames: tuple[str, ...] = ()
    joint: str | None = None
    laws: tuple[tuple[Any, str, str], ...] = ()
    numbers: tuple[float, ...] = ()
    follows: bool = False
    counts_turns: bool = False
    states: int = 0
    bends: tuple[tuple[float, ...], ...] = ()
    reads: tuple[tuple[str, str], ...] = ()
    located: bool = False


def by_formula(formula: Formula, path: str, **acts: Any) -> Row:
    """The row of a load by an expression.  acts: what it acts on."""
    bends, laws = ((0.0,),) * formula.bends, ((TIME, "time", path),)
    return Row(laws=laws, numbers=formula.numbers, bends=bends, reads=formula.reads, located=True, **acts)
