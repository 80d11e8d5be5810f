"""Declaration of wear.

Sliding distance and load path are part of the state: steps and impacts are as exact for them as for the motion.
"""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

WEAR = Effect(
    "wear",
    lambda scene: () if scene.wearing_joints() else None,
    # contacts with wear; outer0, inner0: first numbers of the profiles of worn surfaces. halvings, heights: of their
    # intervals of angle and height; -1: round, 0: of a pin
    topology={"worn": "contact outer0 inner0 halvings heights"},
    numbers={"profiles": "value"},
    changeable=tuple(f"joint.wear.{key}" for key in ("coefficient", "hardness", "sectors", "outer_share")),
    ledger=True,
)
