"""Numbers of a scene as directions in which its model and its start change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.run.alike import engines_alike
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.horizon.tangents import Direction
from flexclear.scene.load import number_at, with_numbers
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError

#: relative change of a number for the derivative of the assembly, a smooth function of the number: central differences
#: over four points have an error of the fourth power, 1e-12, and starts are closed to 1e-13
NUMBER_STEP = 1e-3
#: families of parts, and settings, whose numbers affect the motion
FAMILIES = ("body", "joint", "drive", "load", "stop", "gear", "start")


@dataclass(frozen=True)
class Parameter:
    """A number of a scene."""

    path: str
    value: float
    written_in: str = ""

    @property
    def unit(self) -> float:
        """Unit change of the directions: the number's magnitude, or 1 for zero."""
        return abs(self.value) or 1.0

    def changed(self, amount: float) -> float | str:
        """Return the number changed by `amount` of its units, as the scene writes numbers."""
        number = float(self.value + amount * self.unit)
        return f"{number!r} {self.written_in}" if self.written_in else number


@dataclass(frozen=True)
class Family:
    """Engines of a scene with one changed number."""

    scene: Scene
    bundles: Mapping[str, Labelled]
    engine: Engine

    def parameter(self, path: str) -> Parameter:
        """Return the number at a key path; raise InputError for anything else, or a number that the motion ignores."""
        if path.partition(".")[0] not in FAMILIES:
            raise InputError(path, f"is not a number of {', '.join(FAMILIES)}", "name one, as joint.A1.clearance")
        return Parameter(path, *number_at(self.scene, path))

    def changed(self, parameter: Parameter, amount: float) -> Engine:
        """Return the engine with a number changed by `amount` of its units; raise InputError if the structure changes.

        Its code and its choices of method are those of the unchanged scene.
        """
        edited = with_numbers(self.scene, {parameter.path: parameter.changed(amount)})
        engine, _ = engines_alike(self.engine, edited, self.bundles)
        if not np.array_equal(engine.model.arrays.h, self.engine.model.arrays.h):
            raise InputError(parameter.path, "changes the structure of the mechanism, not only numbers", "leave it out")
        return engine

    def direction(self, parameter: Parameter) -> Direction:
        """Return the change of numbers and start per unit of a parameter."""
        around = {k: self.changed(parameter, k * NUMBER_STEP) for k in (-2, -1, 1, 2)}
        numbers = {k: engine.model.arrays.f for k, engine in around.items()}
        starts = {k: consistent_start(engine) for k, engine in around.items()}
        return Direction(central(numbers, NUMBER_STEP), central(starts, NUMBER_STEP))


def central(values: Mapping[int, np.ndarray], step: float) -> np.ndarray:
    """Return the derivative from values at -2, -1, 1 and 2 steps, to the fourth power of the step."""
    return np.asarray((values[-2] - 8.0 * values[-1] + 8.0 * values[1] - values[2]) / (12.0 * step))
