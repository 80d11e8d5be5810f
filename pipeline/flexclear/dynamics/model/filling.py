"""Blocks of the ledger and tables that effects add to a model, next to those of contacts and loads."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.effects import Parts
from flexclear.dynamics.effects.gears.model import Coupling
from flexclear.dynamics.model import contacts
from flexclear.dynamics.model.components import Floors, Group
from flexclear.dynamics.model.gauges import Gauges
from flexclear.dynamics.model.mechanism import Closure, Mechanism
from flexclear.dynamics.model.numbering import Numbering

#: number of ledger entries of loads: work done, energy lost
LOADS = 2
#: entries of each independent mechanism but the first: work of drives, loss of modal damping, work and loss of loads
OTHER_BOOKS = 4


def blocks(mechanism: Mechanism, parts: Parts, energies: Floors, lengths: Floors) -> dict[str, list[Group]]:
    """Return the error groups of each block of the ledger, in the order of the state; effects have blocks by name.

    energies, lengths: floors of each independent mechanism.
    """
    of_the_first, effects = [(float(energies[0]), 1, 0)], [effect for effect in parts.present if effect.ledger]
    return {
        "mechanism": of_the_first * m.CONTACT_SLOTS,
        **contacts.ledger(mechanism, energies, lengths),
        "loads": of_the_first * (LOADS if mechanism.scene.forces() else 0),
        **{effect.name: effect.load(effect.ledger)(mechanism, energies, lengths) for effect in effects},
        "books": [(float(energy), OTHER_BOOKS, part) for part, energy in enumerate(energies) if part],
    }


def slots(mechanism: Mechanism, parts: Parts) -> dict[str, int]:
    """Return the index in the ledger at which each block begins, and the ledger's `end`."""
    ones = np.ones(len(mechanism.components.lengths))
    counts = {name: sum(n for _, n, _ in groups) for name, groups in blocks(mechanism, parts, ones, ones).items()}
    return dict(zip([*counts, "end"], accumulate(counts.values(), initial=0), strict=True))


class Filling(NamedTuple):
    """Data from which effects fill their tables.

    closures: in the order of the table CLOSURES.  gauges: receives those of the effects.  slots: see the function.
    """

    numbering: Numbering
    parts: Parts
    closures: tuple[Closure | Coupling, ...]
    gauges: Gauges
    slots: Mapping[str, int]


def tables(filling: Filling) -> dict[Any, Any]:
    """Return the tables of all effects; those of effects that the mechanism lacks are empty."""
    filled: dict[Any, Any] = {m.NAMED[name]: () for name in m.OF_EFFECTS if m.ARRAYS[name] != "w"}
    for fill in filling.parts.functions("fill"):
        filled |= {m.NAMED[name]: rows for name, rows in fill(filling).items()}
    return filled
