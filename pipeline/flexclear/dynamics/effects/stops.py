"""Declaration of stops."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

STOPS = Effect(
    "stops",
    lambda scene: () if scene.stops() else None,
    touches=True,
)
