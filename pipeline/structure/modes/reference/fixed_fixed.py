"""Both ends clamped to the body frame, wherever the joints are: of a beam its ends, of a solid its first interfaces.

Both ends stay rigid, so joints there see no compliance at all (which is the truth of this basis).
Source: Wang & Wang (2019), eq. (6), sec. 3.4 and Table 4.
"""

from __future__ import annotations

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.model import Model, rows
from flexclear.pipeline.structure.modes.condition import WHERE, Condition, Given, holding


def condition(model: Model, given: Given) -> Condition:
    """Normal modes between clamped ends; InputError when there are none, or nothing is free between them."""
    if len(model.ends) < 2:
        raise InputError(WHERE, "a fixed-fixed basis clamps two ends", "name two interfaces in the recipe")
    if model.size <= 6 * len(model.ends):
        raise InputError(WHERE, "one element has no coordinate between two clamped ends", "use at least 2")
    names = " and ".join(f"'{end.name}'" for end in model.ends)
    return holding(
        rows(model.ends, model.size), f"the body frame rides on the clamped {names}; no rigid motion is left"
    )
