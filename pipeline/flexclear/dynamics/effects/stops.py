"""Declaration of stops."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

STOPS = Effect(
    "stops",
    lambda scene: () if scene.stop else None,
    compose={"forces": {"stops": "<contact.stops.make_stops>({file.forms})"}},
    touches=True,
)
