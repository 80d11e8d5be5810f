"""The declaration of controllers, whose forces are loads."""

from __future__ import annotations

from flexclear.pipeline.dynamics.effects.effect import Effect

TYPES = ("pid", "sampled-pid")
CONTROLLERS = Effect(
    "controllers",
    lambda scene: () if any(load.type in TYPES for load in scene.load.values()) else None,
    records={("controller_",): "record:controllers"},
    samples="run:sampler",
    refuses="run:require_controlled",
)
