"""Numbers of a scene as directions in which its model and its start change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import closed_start
from flexclear.dynamics.run.horizon.tangents import Direction
from flexclear.dynamics.run.run import engines
from flexclear.dynamics.sensitivity.recipes import Varied
from flexclear.scene.load import number_at, with_numbers
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent

#: changes of a number, in its units, for the derivative of the start: the first one at which a start exists on both
#: sides and at which differences over two and over four points agree, as a fraction of the start's change or, for
#: starts that are closed to 1e-13, of its magnitude. Those over four points then err by the square of that
NUMBER_STEPS, AGREEMENT, SLIGHT = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7), 1e-3, 1e-6
#: change between starts, of their magnitude, above which no differences count as derivatives: bodies that nothing holds
#: may turn as they like from one equilibrium to another
WIDEST = 1e-2
#: families of parts, and settings, whose numbers affect the motion
FAMILIES = ("body", "joint", "drive", "load", "stop", "gear", "start")


@dataclass(frozen=True)
class Parameter:
    """A number of a scene; size: of the vector to which it belongs, 0 for a number of its own."""

    path: str
    value: float
    written_in: str = ""
    size: float = 0.0

    @property
    def unit(self) -> float:
        """Unit change of the directions: the magnitude of the number or of its vector, or 1 for zero."""
        return max(abs(self.value), self.size) or 1.0

    def changed(self, amount: float) -> float | str:
        """Return the number changed by `amount` of its units, as the scene writes numbers."""
        number = float(self.value + amount * self.unit)
        return f"{number!r} {self.written_in}" if self.written_in else number


@dataclass(frozen=True)
class Family:
    """Engines of a scene with one changed number; varied: numbers of recipes, by path."""

    scene: Scene
    bundles: Mapping[str, Labelled]
    engine: Engine
    varied: Mapping[str, Varied] = field(default_factory=dict)

    def parameter(self, path: str) -> Parameter:
        """Return the number at a key path; raise InputError for anything else, or a number that the motion ignores."""
        if path.partition(".")[0] not in FAMILIES:
            raise InputError(path, f"is not a number of {', '.join(FAMILIES)}", "name one, as joint.A1.clearance")
        if path in self.varied:
            return Parameter(path, self.varied[path].value, self.varied[path].written_in)
        return Parameter(path, *number_at(self.scene, path), _size(self.scene, path))

    def changed(self, parameter: Parameter, amount: float) -> Engine:
        """Return the engine with a number changed by `amount` of its units; raise InputError if the structure changes.

        Its code and its choices of method are those of the unchanged scene.
        """
        if parameter.path in self.varied:
            one = self.varied[parameter.path]
            bundles = {**self.bundles, one.body: one.bundle(self.bundles[one.body], amount)}
            engine, _ = engines(self.scene, bundles, silent)
        else:
            edited = with_numbers(self.scene, {parameter.path: parameter.changed(amount)})
            engine, _ = engines(edited, self.bundles, silent, self.engine)
        if not np.array_equal(engine.model.arrays.h, self.engine.model.arrays.h):
            raise InputError(parameter.path, "changes the structure of the mechanism, not only numbers", "leave it out")
        return engine

    def direction(self, parameter: Parameter) -> tuple[Direction, float]:
        """Return the change of numbers and start per unit of a parameter, and the step of the differences."""
        found, failed, least, scales = None, None, np.inf, self.engine.magnitudes
        for step in NUMBER_STEPS:
            try:
                around = {k: self.changed(parameter, k * step) for k in (-2, -1, 1, 2)}
                starts = {k: closed_start(engine) for k, engine in around.items()}
            except (InputError, SolverError) as error:
                failed = error
                continue
            numbers = {k: engine.model.arrays.f for k, engine in around.items()}
            direction = Direction(central_difference(numbers, step), central_difference(starts, step))
            narrow = (starts[1] - starts[-1]) / (2.0 * step)
            off, size = (float(np.linalg.norm(v / scales)) for v in (narrow - direction.start, direction.start))
            wide = float(np.linalg.norm((starts[2] - starts[-2]) / scales)) > WIDEST
            merit = off / (AGREEMENT * size + SLIGHT) + (1.0 / step if wide else 0.0)
            if merit < least:
                found, least = (direction, step), merit
            if least <= 1.0:
                break
        if found is None:
            raise failed  # type: ignore[misc]
        return found


def _size(scene: Scene, path: str) -> float:
    """Return the largest of the three components among which a number is, 0 for another number."""
    vector, _, last = path.rpartition(".")
    try:
        numbers = [number_at(scene, f"{vector}.{k}") for k in range(3)] if last.isdecimal() else []
    except InputError:
        return 0.0
    return max((abs(value) for value, _ in numbers), default=0.0) if len({unit for _, unit in numbers}) == 1 else 0.0


def central_difference(values: Mapping[int, np.ndarray], step: float) -> np.ndarray:
    """Return the derivative from values at -2, -1, 1 and 2 steps, to the fourth power of the step."""
    return np.asarray((values[-2] - 8.0 * values[-1] + 8.0 * values[1] - values[2]) / (12.0 * step))
