"""The declaration of stops."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.pipeline.dynamics.effects.effect import FORMS, NORMAL_LAWS, PACKAGE, Effect

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.effects.composition import Composition


def _forces(file: Composition) -> None:
    forms = "".join(f"{form}, " for form in file.family(FORMS, file.parts.forms))
    file.given["stops"] = f"{file.take(f'{PACKAGE}.stops.contact', 'make_stops')}(({forms}))"


STOPS = Effect(
    "stops",
    lambda scene: () if scene.stop else None,
    lambda scene: ((NORMAL_LAWS, stop.normal.law, f"[stop.{name}.normal]") for name, stop in scene.stop.items()),
    touches=True,
    compose={"forces": _forces},
    acts="record:on_stopped_frames",
)
