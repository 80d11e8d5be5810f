"""Declaration of wear.

Sliding distance and load path are part of the state: steps and impacts are as exact for them as for the motion.
"""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

WEAR = Effect(
    "wear",
    lambda scene: () if scene.wearing_joints() else None,
    topology={"worn": "contact"},  # contacts with wear
    changeable=("joint.wear",),
    ledger=True,
)
