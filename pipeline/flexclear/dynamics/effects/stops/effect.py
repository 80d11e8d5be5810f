"""Declaration of stops."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

STOPS = Effect(
    "stops",
    lambda scene: () if scene.stop else None,
    named=lambda scene: (
        ("contact.normal", stop.normal.law, f"[stop.{name}.normal]") for name, stop in scene.stop.items()
    ),
    compose={"forces": {"stops": "<contact.make_stops>({file.forms})"}},
    touches=True,
    acts="record:on_stopped_frames",
)
