"""The tables of effects, each filled by the effect itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects import Parts
from flexclear.pipeline.dynamics.model.gauges import Gauges
from flexclear.pipeline.dynamics.model.numbering import Numbering

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.effects.gears.model import Coupling
    from flexclear.pipeline.dynamics.model.mechanism import Closure


class Filling(NamedTuple):
    """What effects fill their tables from.

    closures: as the table CLOSURES has them.  gauges: take those of the effects.  slots: see `model.ledger`.
    """

    numbering: Numbering
    parts: Parts
    closures: tuple[Closure | Coupling, ...]
    gauges: Gauges
    slots: Mapping[str, int]


def tables(filling: Filling) -> dict[Any, Any]:
    """Rows of the tables of all effects; those of effects that the mechanism lacks are empty."""
    filled = {m.NAMED[name]: () for name in m.OF_EFFECTS if m.ARRAYS[name] != "w"}
    for effect in filling.parts.present:
        if effect.fill:
            filled |= {m.NAMED[name]: rows for name, rows in effect.load(effect.fill)(filling).items()}
    return filled
