"""The ledger: variables of the state that are integrals of powers and rates, in blocks by what they are of."""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects import present
from flexclear.pipeline.dynamics.model import contacts
from flexclear.pipeline.dynamics.model.components import Floors, Group
from flexclear.pipeline.dynamics.model.mechanism import Mechanism

#: what loads add: work done, energy lost
LOADS = 2
#: of an independent mechanism that is not the first one: work of drives, loss of modal damping, work and loss of loads
OTHER_BOOKS = 4


def blocks(mechanism: Mechanism, energies: Floors, lengths: Floors) -> dict[str, list[Group]]:
    """The error groups of each block, in the order of the state: those of effects by their names.

    energies, lengths: floors of each independent mechanism.
    """
    scene, of_the_first = mechanism.scene, [(float(energies[0]), 1, 0)]
    effects = [effect for effect in present(scene) if effect.ledger]
    return {
        "mechanism": of_the_first * m.CONTACT_SLOTS,
        **contacts.ledger(mechanism, energies, lengths),
        "loads": of_the_first * (LOADS if scene.forces() else 0),
        **{effect.name: effect.load(effect.ledger)(mechanism, energies, lengths) for effect in effects},
        "books": [(float(energy), OTHER_BOOKS, part) for part, energy in enumerate(energies) if part],
    }


def slots(mechanism: Mechanism) -> dict[str, int]:
    """The index in the ledger at which each block begins, and the ledger's `end`."""
    ones = np.ones(len(mechanism.components.lengths))
    counts = {name: sum(n for _, n, _ in groups) for name, groups in blocks(mechanism, ones, ones).items()}
    return dict(zip([*counts, "end"], accumulate(counts.values(), initial=0), strict=True))
