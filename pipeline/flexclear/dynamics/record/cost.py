"""Processor time of a run, separately for integration and record.

A record has as many rows whatever the integration took, and costs far more than the integration of a smooth motion.
The sum of both times says little of either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from flexclear.dynamics.record.dataset import recorded
from flexclear.dynamics.run.evaluation.engine import Engine, another
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.ledger import require_closed
from flexclear.dynamics.run.run import Run, engines, follow, observed
from flexclear.dynamics.run.trajectory import Followed, Trajectory
from flexclear.scene.schema import Scene
from flexclear.system.progress import Progress, silent

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.equations.observation import Observed
    from flexclear.dynamics.run.horizon.horizon import PerturbedRun

#: least number of repeats of an integration; short ones are repeated until they have taken this time [s] together, at
#: most that often: a disturbance of a millisecond is a tenth of some. A run of LONG_RUN [s] is not repeated
REPEATS, ENOUGH_TIME, MOST_REPEATS, LONG_RUN = 3, 0.05, 15, 1.5


@dataclass(frozen=True)
class Cost:
    """Processor times [s] of repeated integrations and records, with warm caches, and the run.

    run: the dataset of any run (schema RUN).  length: size of the mechanism [m].  The times exclude the perturbed run
    of a scene with contacts, set-up, and the check of the energy ledger.
    """

    run: xr.Dataset
    integration: tuple[float, ...]
    recording: tuple[float, ...]
    length: float


def measure(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress = silent,
    *,
    checked: bool = True,
    brief: bool = False,
) -> Cost:
    """Measure the cost of a scene's run, with compiled code loaded before; the scene's `[accuracy]` is ignored.

    checked: refuse a run whose energy ledger does not close, as every run does.
    brief: leave out the perturbed run of a scene with contacts and repeats of the record; the first run is then the
    first measurement.
    Raises InputError and SolverError as a run does.
    """
    engine, other = engines(scene, bundles, progress)
    start = consistent_start(engine)
    begun, single = process_time(), brief or not engine.model.contacts
    last, trajectory, switched, perturbed = _followed(engine, start, progress, other, single)
    first = (process_time() - begun,) if single else ()
    seen = observed(last, trajectory)
    if checked:
        require_closed(last.model, trajectory, seen)

    def record(seen: Observed, perturbed: PerturbedRun | None = None) -> xr.Dataset:
        return recorded(Run(scene, last, trajectory, seen, perturbed, switched)).to_xarray()

    again = lambda: record(observed(last, trajectory))  # noqa: E731
    recording = (_once(again),) if brief else _repeated(again, 0)
    run = record(seen, perturbed)
    integration = _repeated(lambda: follow(engine, start, silent, other), MOST_REPEATS, first)
    return Cost(run, integration, recording, engine.model.length)


def _followed(
    engine: Engine, start: np.ndarray, progress: Progress, other: Callable[[str], Engine], single: bool
) -> tuple[Engine, Trajectory, str, PerturbedRun | None]:
    """Return the run and, unless `single`, the perturbed run, which follows so that it does not slow the run down."""
    if single:
        return *follow(engine, start, progress, other), None
    from flexclear.dynamics.run.horizon.horizon import Pair

    pair = Pair(engine)
    followed = pair.run(lambda *text: follow(engine, start, progress, other, None, *text))

    def steps(mine: Engine, y: np.ndarray, *text: Any) -> Followed:
        return follow(mine, y, silent, lambda name: another(other(name)), None, *text)

    return *followed, pair.perturbed_run(start, steps, silent)


def _repeated(task: Callable[[], object], most: int, first: tuple[float, ...] = ()) -> tuple[float, ...]:
    """Return processor times [s] of a task, `first` among them: REPEATS, or up to `most` of a short one."""
    seconds = [*first]
    while not seconds or (sum(seconds) < LONG_RUN and len(seconds) < REPEATS):
        seconds.append(_once(task))
    while len(seconds) < most and sum(seconds) < ENOUGH_TIME:
        seconds.append(_once(task))
    return tuple(seconds)


def _once(task: Callable[[], object]) -> float:
    begun = process_time()
    task()
    return process_time() - begun
