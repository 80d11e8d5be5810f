"""Declaration of controllers, whose forces are loads."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

TYPES = ("pid", "sampled-pid")
NUMBERS = ("reference", "proportional", "integral", "derivative", "limits", "tracking_time", "period")
CONTROLLERS = Effect(
    "controllers",
    lambda scene: () if any(load.type in TYPES for load in scene.load.values()) else None,
    changeable=tuple(f"load.{key}" for key in NUMBERS),
)
