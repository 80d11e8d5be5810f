"""Free-interface normal modes and inertia-relief attachment modes, in mean axes.

The attachment modes are the answers of the free body to unit forces and moments at the interfaces, balanced by its own
inertia; with them the static response at the interfaces is exact. Their rigid motion depends on the supports that they
were computed with and is taken out by mass orthogonality, which leaves shapes without momentum.
Source: Craig & Chang (1977), NASA CR-2731; Craig & Kurdila (2006), ch. 17.
"""

from __future__ import annotations

from flexclear.pipeline.structure.fe.model import Model, rows
from flexclear.pipeline.structure.modes.condition import Condition, Given, different, floating, joined

NOTE = "six rigid-body modes were left out; the attachment modes' rigid motion was taken out by mass orthogonality"


def condition(model: Model, given: Given) -> Condition:
    """Six attachment modes per interface and normal modes of the free body; InputError without interfaces."""
    different(joined(given, 1, "attachment modes need an interface to load"))
    return floating(model, NOTE, rows(given.interfaces, model.size))
