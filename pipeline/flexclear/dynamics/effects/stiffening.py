"""Declaration of the stiffening of flexible bodies."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

STIFFENING = Effect(
    "stiffening",
    lambda scene: () if any(body.stiffening is not None for body in scene.flexible().values()) else None,
    compose={"forces": {"flexible": "flexible_bodies(<bodies.stiffening>)"}},
)
