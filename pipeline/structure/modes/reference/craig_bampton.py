"""Body frame clamped at the first interface; constraint modes of the others and fixed-interface normal modes.

The static response to forces and moments at the interfaces is exact with any number of normal modes.
Source: Craig & Bampton (1968), AIAA Journal 6, 1313-1319.
"""

from __future__ import annotations

import numpy as np

from flexclear.pipeline.structure.fe.model import Model, rows
from flexclear.pipeline.structure.modes.condition import Condition, Given, different, holding, joined


def condition(model: Model, given: Given) -> Condition:
    """Six constraint modes per further interface, and normal modes with all interfaces clamped.

    Raises InputError without interfaces, and when two are the same.
    """
    different(joined(given, 1, "a Craig-Bampton basis needs at least one interface"))
    held = rows(given.interfaces, model.size)
    first = given.interfaces[0].name
    note = f"the body frame rides on '{first}', where all shapes vanish; no rigid motion is left"
    return holding(held, note, moved=np.arange(6, held.shape[0]))
