"""Blocks of the ledger and tables that effects add to a model, next to those of contacts and loads."""

from __future__ import annotations

from itertools import accumulate
from typing import Any

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.effects import Parts
from flexclear.dynamics.model import contacts, gears, joint_friction, stiffening, wear
from flexclear.dynamics.model.components import Floors, Group
from flexclear.dynamics.model.filling import Filling
from flexclear.dynamics.model.guards import Guard
from flexclear.dynamics.model.mechanism import Mechanism
from flexclear.scene.films import actions_of

#: rows of an effect's tables by name, from a `Filling`
FILLS = {
    "gears": gears.fill,
    "joint_friction": joint_friction.fill,
    "stiffening": stiffening.fill,
    "wear": wear.fill,
}
#: groups of its block of the ledger
LEDGERS = {"joint_friction": joint_friction.ledger, "wear": wear.ledger}
#: rows of the table GUARDS
GUARDS = {"joint_friction": joint_friction.guards}
#: number of ledger entries of loads: work done, energy lost
LOADS = 2
#: entries of each independent mechanism but the first: work of drives, loss of modal damping, work and loss of loads
OTHER_BOOKS = 4


def blocks(mechanism: Mechanism, parts: Parts, energies: Floors, lengths: Floors) -> dict[str, list[Group]]:
    """Return the error groups of each block of the ledger, in the order of the state; effects have blocks by name.

    energies, lengths: floors of each independent mechanism.
    """
    of_the_first, effects = [(float(energies[0]), 1, 0)], [one.name for one in parts.present if one.name in LEDGERS]
    return {
        "mechanism": of_the_first * m.CONTACT_SLOTS,
        **contacts.ledger(mechanism, energies, lengths),
        "loads": of_the_first * (LOADS if actions_of(mechanism.scene) else 0),
        **{name: LEDGERS[name](mechanism, energies, lengths) for name in effects},
        "books": [(float(energy), OTHER_BOOKS, part) for part, energy in enumerate(energies) if part],
    }


def guards(mechanism: Mechanism, parts: Parts) -> list[Guard]:
    """Return the guards of all effects."""
    return [guard for made in parts.functions(GUARDS) for guard in made(mechanism)]


def slots(mechanism: Mechanism, parts: Parts) -> dict[str, int]:
    """Return the index in the ledger at which each block begins, and the ledger's `end`."""
    ones = np.ones(len(mechanism.components.lengths))
    counts = {name: sum(n for _, n, _ in groups) for name, groups in blocks(mechanism, parts, ones, ones).items()}
    return dict(zip([*counts, "end"], accumulate(counts.values(), initial=0), strict=True))


def tables(filling: Filling) -> dict[Any, Any]:
    """Return the tables of all effects; those of effects that the mechanism lacks are empty."""
    filled: dict[Any, Any] = {m.NAMED[name]: () for name in m.OF_EFFECTS if m.ARRAYS[name] != "w"}
    for fill in filling.parts.functions(FILLS):
        filled |= {m.NAMED[name]: rows for name, rows in fill(filling).items()}
    return filled
