"""The declaration of the stiffening of flexible bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.pipeline.dynamics.effects.effect import PACKAGE, Effect

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.effects.composition import Composition


def _forces(file: Composition) -> None:
    file.given["flexible"] = f"flexible_bodies({file.take(f'{PACKAGE}.stiffening', 'bodies')})"


STIFFENING = Effect(
    "stiffening",
    lambda scene: () if any(body.stiffening is not None for body in scene.flexible().values()) else None,
    compose={"forces": _forces},
)
