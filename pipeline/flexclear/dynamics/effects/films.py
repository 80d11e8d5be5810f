"""Declaration of films in joints with clearance, whose force is a load."""

from __future__ import annotations

from flexclear.dynamics.effects.effect import Effect
from flexclear.scene.films import films_of

FILMS = Effect("films", lambda scene: () if films_of(scene) else None)
