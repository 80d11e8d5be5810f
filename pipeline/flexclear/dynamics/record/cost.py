"""Processor time of a run, separately for integration and record.

A record has as many rows whatever the integration took, and costs far more than the integration of a smooth motion.
The sum of both times says little of either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import process_time
from typing import TYPE_CHECKING

import xarray as xr

from flexclear.dynamics.record.dataset import record_run
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.ledger import require_closed
from flexclear.dynamics.run.run import Run, engines, follow, observe_run, rows_to_judge
from flexclear.dynamics.run.trajectory import Followed
from flexclear.scene.schema import Scene
from flexclear.system.progress import Progress, silent

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled

#: least number of repeats of an integration; short ones are repeated until they have taken this time [s] together, at
#: most that often: a disturbance of a millisecond is a tenth of some. A run of LONG_RUN [s] is not repeated
REPEATS, ENOUGH_TIME, MOST_REPEATS, LONG_RUN = 3, 0.05, 15, 0.2


@dataclass(frozen=True)
class Cost:
    """Processor times [s] of repeated integrations and records, with warm caches, and the run.

    run: the dataset of a run (schema RUN), without predictability horizon.  length: size of the mechanism [m].  The
    times exclude set-up, and the check of the energy ledger.
    """

    run: xr.Dataset
    integration: tuple[float, ...]
    recording: tuple[float, ...]
    length: float


def measure(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress = silent, *, checked: bool = True
) -> Cost:
    """Measure the cost of a scene's run, with compiled code loaded before; the scene's `[accuracy]` is ignored.

    checked: refuse a run whose energy ledger does not close, as every run does.
    Raises InputError and SolverError as a run does.
    """
    engine, other = engines(scene, bundles, progress)
    start, runs = consistent_start(engine), list[Followed]()

    def integrate() -> None:
        runs.append(follow(engine, start, silent if runs else progress, other))

    first = _time_once(integrate)
    last, trajectory, switched = runs[0]
    seen = observe_run(last, trajectory)
    if checked:
        require_closed(last.model, *rows_to_judge(last, trajectory, seen))

    def record() -> xr.Dataset:
        return record_run(Run(scene, last, trajectory, observe_run(last, trajectory), None, switched)).to_xarray()

    run, recording = record(), _repeat_timing(record, 0)
    return Cost(run, _repeat_timing(integrate, MOST_REPEATS, (first,)), recording, engine.model.length)


def _repeat_timing(task: Callable[[], object], most: int, first: tuple[float, ...] = ()) -> tuple[float, ...]:
    """Return processor times [s] of a task, `first` among them: REPEATS, or up to `most` of a short one."""
    seconds = [*first]
    while not seconds or (sum(seconds) < LONG_RUN and len(seconds) < REPEATS):
        seconds.append(_time_once(task))
    while len(seconds) < most and sum(seconds) < ENOUGH_TIME:
        seconds.append(_time_once(task))
    return tuple(seconds)


def _time_once(task: Callable[[], object]) -> float:
    begun = process_time()
    task()
    return process_time() - begun
