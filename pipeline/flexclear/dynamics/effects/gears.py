"""Declaration of gears."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

GEARS = Effect(
    "gears",
    lambda scene: () if scene.gear else None,
    topology={"couplings": "first second"},  # gauges of two joint coordinates; the second follows the first
    numbers={"coupling_numbers": "ratio offset"},  # second coordinate = ratio * first + offset
)
