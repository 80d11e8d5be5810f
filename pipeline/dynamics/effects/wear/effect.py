"""The declaration of wear.

Sliding distance and load path are part of the state, so that steps and impacts are as exact in them as in the motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.pipeline.dynamics.effects.effect import PACKAGE, Effect

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.effects.composition import Composition


def _forces(file: Composition) -> None:
    file.given["contacts"] = f"{file.take(f'{PACKAGE}.wear.contact', 'wearing')}({file.given['contacts']})"


WEAR = Effect(
    "wear",
    lambda scene: () if scene.worn() else None,
    wiring={"worn": "contact"},  # contacts whose wear is counted
    ledger="model:ledger",
    fill="model:fill",
    compose={"forces": _forces},
    records={("wear_",): "record:wear_series"},
)
