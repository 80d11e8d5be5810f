"""Row of a load: the frames or joint it acts on, and its data, as its module reads them from the scene."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from flexclear.dynamics import lookup
from flexclear.scene.formulas import Formula
from flexclear.scene.laws import Polynomial
from flexclear.scene.units import quantity_at
from flexclear.system.errors import all_or_errors

#: the time itself, as a law
TIME = Polynomial(type="polynomial", coefficients=(0.0, 1.0))


@dataclass(frozen=True)
class Row:
    """Data of one load.

    frames: the frame acted on, or the two between which the load acts; or `joint`: the frames of this joint.
    laws: law, dimension and key path of each.  numbers: as many as the load needs.  follows: True when the load turns
    with its frame.  counts_turns: True when it needs its angle beyond half a turn.  states: number of internal states.
    bends: for each number that it stores in LOAD_BENDS, the magnitudes, as speeds, at which slope or curvature
    jumps; 0.0: at a change of sign; empty: nowhere. The scene's model of the load has `bends` where steps end there.
    reads: sort and name of each argument of an expression (`formulas.Formula`).  located: True when the mechanism's
    origin, from which positions are measured, precedes its numbers.
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


def numbers(load: Any, path: str, **dimensions: str) -> list[float]:
    """Return the numbers of these keys of a load in SI; raise the InputErrors of all that have another dimension."""
    keys = dimensions.items()
    return all_or_errors(partial(quantity_at, f"{path[:-1]}.{key}]", getattr(load, key), of) for key, of in keys)


def by_formula(formula: Formula, path: str, **acts: Any) -> Row:
    """Return the row of a load by an expression.  acts: the frames or joint that the load acts on."""
    bends, laws = ((0.0,),) * formula.bends, ((TIME, "time", path),)
    looked_up = tuple(number for table in formula.tables for number in lookup.numbers(table))
    return Row(laws=laws, numbers=formula.numbers + looked_up, bends=bends, reads=formula.reads, located=True, **acts)
