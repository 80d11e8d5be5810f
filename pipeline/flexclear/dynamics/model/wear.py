"""Contacts with wear, and their variables in the ledger."""

from __future__ import annotations

from typing import Any

from flexclear.dynamics.model.components import Floors, Group
from flexclear.dynamics.model.contacts import part_of
from flexclear.dynamics.model.filling import Filling
from flexclear.dynamics.model.mechanism import Mechanism


def _worn(mechanism: Mechanism) -> list[int]:
    names = [contact.name for contact in mechanism.contacts]
    return [names.index(name) for name in mechanism.scene.wearing_joints()]


def fill(filling: Filling) -> dict[str, Any]:
    """Tabulate the contacts with wear."""
    return {"worn": _worn(filling.numbering.mechanism)}


def ledger(mechanism: Mechanism, energies: Floors, lengths: Floors) -> list[Group]:
    """Return the ledger groups, sliding distance and load path of each contact with wear."""
    parts = [part_of(mechanism, mechanism.contacts[k]) for k in _worn(mechanism)]
    return [(floor[part], 1, part) for part in parts for floor in (lengths, energies)]
