"""Data from which effects fill their tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from flexclear.dynamics.effects import Parts
    from flexclear.dynamics.model.gauges import Gauges
    from flexclear.dynamics.model.gears import Coupling
    from flexclear.dynamics.model.mechanism import Closure
    from flexclear.dynamics.model.numbering import Numbering


class Filling(NamedTuple):
    """Data from which effects fill their tables.

    closures: in the order of the table CLOSURES.  gauges: receives those of the effects.
    slots: see `of_effects.slots`.
    """

    numbering: Numbering
    parts: Parts
    closures: tuple[Closure | Coupling, ...]
    gauges: Gauges
    slots: Mapping[str, int]
