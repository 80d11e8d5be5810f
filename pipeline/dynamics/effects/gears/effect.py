"""The declaration of gears."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexclear.pipeline.dynamics.effects.effect import PACKAGE, Effect

if TYPE_CHECKING:
    from flexclear.pipeline.dynamics.effects.composition import Composition

EQUATIONS = f"{PACKAGE}.gears.equations"


def _closures(file: Composition) -> None:
    file.given["closures"] = f"{file.take(EQUATIONS, 'make_coupled_closing')}({file.tree()})"


def _observe(file: Composition) -> None:
    file.given["couplings"] = file.take(EQUATIONS, "take_off_first_joints")


GEARS = Effect(
    "gears",
    lambda scene: () if scene.gear else None,
    wiring={"couplings": "first second"},  # gauges of two joint coordinates, of which the second follows the first
    numbers={"coupling_numbers": "ratio offset"},  # second coordinate = ratio * first + offset
    fill="model:fill",
    compose={"closures": _closures, "observe": _observe},
    records={("gear_",): "record:gear_series"},
    acts="record:on_geared_frames",
)
