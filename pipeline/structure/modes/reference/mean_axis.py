"""Mean axes of any basis (Tisserand's or Buckens' frame): another condition's shapes without their rigid motion.

Source: Canavin & Likins (1977), J. Spacecraft 14, 724-732; Shabana, *Dynamics of Multibody Systems*, ch. 5.
"""

from __future__ import annotations

from dataclasses import replace

from flexclear.pipeline.core.scene.registry import lookup
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.modes.condition import Condition, Given

FAMILY = "flexclear.pipeline.structure.modes.reference"


def condition(model: Model, given: Given) -> Condition:
    """The shapes of the condition that `given.of` names, linear and angular momentum taken out."""
    if given.of is None or given.of == "mean-axis":
        raise InputError(
            "modes.of",
            "mean-axis changes the shapes of another condition, and none is named",
            'name it, as of = "craig-bampton"',
        )
    based: Condition = lookup(FAMILY, given.of, where="modes.of")(model, given)
    note = f"shapes of {given.of}; their linear and angular momentum was taken out"
    return replace(based, mean_axes=True, note=note)
