"""Declaration of bushings, whose force is a load."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

BUSHINGS = Effect(
    "bushings",
    lambda scene: () if any(load.type == "bushing" for load in scene.load.values()) else None,
)
