"""Declaration of films in joints with clearance, whose force is a load."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect

FILMS = Effect("films", lambda scene: () if scene.films() else None)
