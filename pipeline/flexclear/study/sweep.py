"""``flexclear sweep``: many points of one scene, each stored as soon as it is done."""

from __future__ import annotations

import pickle
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr

from flexclear.artifacts.points import Point
from flexclear.artifacts.store import disk_limits, write_dataset
from flexclear.scene.load import is_file, load_scene
from flexclear.scene.schema import Scene
from flexclear.scene.sweep import Sweep, load_sweep, read_sweep
from flexclear.stages import scenes
from flexclear.stages.sweeps import sweep_large, sweep_plan
from flexclear.stages.sweeps.sweep_engine import Engine, Job, engine
from flexclear.stages.workplace import Workplace, open_workplace, relative
from flexclear.system.errors import InputError
from flexclear.workflow import cores

#: name of the shown files, without their endings
NAME = "sweep"
#: name of a sweep without a file
UNNAMED = "sweep"
#: finished points are stored after so many seconds, later after that fraction of the time so far
OFTEN, FRACTION = 2.0, 0.01


def width(asked: int | None) -> int:
    """Return the number of workers; InputError for a number below one."""
    if asked is not None and asked < 1:
        raise InputError("--jobs", f"must be at least 1, not {asked}", "leave it out to use every core")
    return asked or cores.count_cores()


def read(path: Path, settings: Sequence[str] = ()) -> tuple[Sweep, Scene]:
    """Return a sweep file and its scene, which is searched next to the file, then below scenes/.

    settings: changes of the scene at all points, ``KEY=VALUE`` as of `--set`.
    """
    sweep = load_sweep(path)
    own_path = path.parent / sweep.scene
    try:
        scene_path = own_path if is_file(own_path) else scenes.find_scene(sweep.scene)
    except InputError as error:
        raise InputError(f"{path} [scene]", f"'{sweep.scene}' {error.problem}", error.remedy) from None
    scene = load_scene(scene_path, scenes.overrides(settings))
    scenes.examine(scene, settings)
    return sweep, scene


def of_scene(
    scene: Scene, table: Mapping[str, Any], workers: int | None = None, scheduler: str | None = None
) -> xr.Dataset:
    """Return the dataset of a sweep from a table with the keys of a sweep file except its scene; see `fc.sweep`."""
    plan = sweep_plan.plan(read_sweep({"scene": scene.name, **table}, UNNAMED), scene, UNNAMED)
    with engine(width(workers), scheduler) as runner:
        return run_sweep(plan, runner, open_workplace())


@dataclass
class _Sink:
    """Collector of finished points: it stores them now and then, and reports progress."""

    plan: sweep_plan.Plan
    workplace: Workplace
    total: int
    done: dict[str, Point]
    waiting: list[tuple[Job, Point]] = field(default_factory=list)
    here: bool = True  #: True when this machine computes the points
    large: bool = False  #: values are left out of `done`: they are in the store, and memory does not hold them
    begun: float = field(default_factory=time.monotonic)
    stored: float = field(default_factory=time.monotonic)
    fresh: int = 0
    refused: int = 0

    def __post_init__(self) -> None:
        self.refused = sum(bool(point.refused) for point in self.done.values())

    def take(self, finished: Sequence[tuple[Job, Point]], report: Callable[[float, str], None]) -> None:
        """Add finished points and report the progress."""
        self.waiting += finished
        self.done |= {job.key: sweep_large.without_values(point) if self.large else point for job, point in finished}
        self.fresh += len(finished)
        self.refused += sum(bool(point.refused) for _, point in finished)
        since = time.monotonic() - self.begun
        if time.monotonic() - self.stored > max(OFTEN, FRACTION * since):
            self.store()
        text = f", {self.refused} refused" if self.refused else ""
        rate = self.fresh / since if since > 0.0 else 0.0
        report(len(self.done) / self.total, f"{len(self.done)} of {self.total} points{text}, {rate:.3g}/s")

    def store(self) -> None:
        """Write the points that are not stored yet into the cache, family by family."""
        self.stored = time.monotonic()
        for family in self.plan.families:
            mine = {job.key: point for job, point in self.waiting if job.family == family.key}
            if mine:
                family.keep(mine, self.workplace.store, self.plan.recorded, self.here)
        self.waiting = []


def run_sweep(plan: sweep_plan.Plan, workers: Engine, workplace: Workplace, folder: Path | None = None) -> xr.Dataset:
    """Return the dataset of a sweep, brought up to date point by point.

    folder: where dataset and figures are shown; Ctrl-C leaves the finished points there. A dataset that memory does not
    hold is written in Zarr's form there, and the returned dataset reads from it. Raises FlexclearError.
    """
    large = folder is not None and sweep_large.is_large(plan)
    if folder is None:
        sweep_large.require_small(plan)
    ready = sweep_plan.prepare(plan, workplace)
    with ExitStack() as locks:
        for family in ready.families:
            locks.enter_context(
                workplace.store.lock(*family.folder, lambda: workplace.monitor.say("waiting for another sweep"))
            )
        if folder is not None:
            shown = str(folder.relative_to(workplace.store.root))
            workplace.store.show_families(shown, {family.folder[0]: family.facts for family in ready.families})
        recorded = () if large else plan.recorded
        points = {
            key: point for family in ready.families for key, point in family.find(workplace.store, recorded).items()
        }
        requested = {job.key: job for job in ready.jobs}
        known = {key: points[key] for key in requested if key in points}
        sink = _Sink(ready, workplace, len(requested), known, here=workers.here, large=large)
        missing = [job for key, job in requested.items() if key not in sink.done]
        try:
            if missing:
                _run(sink, workers, missing)
        finally:
            sink.store()
            if folder is not None and large:
                result = sweep_large.write_points(
                    ready, workplace.store, sink.done, folder / f"{NAME}{sweep_large.SUFFIX}"
                )
                (folder / f"{NAME}.nc").unlink(missing_ok=True)
            else:
                result = ready.dataset(sink.done)
                if folder is not None:
                    _publish(result, folder)
    return result


def _run(sink: _Sink, workers: Engine, missing: list[Job]) -> None:
    monitor = sink.workplace.monitor
    monitor.start(1)
    sweep, scene = sink.plan.sweep, sink.plan.scene
    name = monitor.begin(scene.name if sweep.name == UNNAMED else sweep.name, "sweep")
    packed = {family.key: pickle.dumps(family.work) for family in sink.plan.families}
    failed = True
    try:
        workers.run(missing, packed, lambda finished, _: sink.take(finished, lambda f, t: monitor.update(name, f, t)))
        failed = False
    finally:
        monitor.finish(name, failed=failed)
        monitor.end()


def _publish(result: xr.Dataset, folder: Path) -> None:
    with disk_limits(folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_dataset(folder / f"{NAME}.nc", result)
        shutil.rmtree(folder / f"{NAME}{sweep_large.SUFFIX}", ignore_errors=True)


def summary(plan: sweep_plan.Plan, result: xr.Dataset, file: Path) -> Iterator[str]:
    """Yield lines with the number of points, refusals by their reason, and the dataset's file."""
    refused = [str(reason) for reason in result["reason"].values.ravel() if reason]
    shown = [relative(path) for path in (file, file.with_suffix(".png")) if path.exists()]
    yield f"{plan.sweep.name}: {result['status'].size} points, {len(refused)} refused; {', '.join(shown)}"
    kinds: dict[str, list[str]] = {}
    for reason in refused:
        # to a reader of the summary the same refusal at another time or size is the same
        words = " ".join(word for word in reason.partition("\n")[0].split() if not any(c.isdigit() for c in word))
        kinds.setdefault(words, []).append(reason)
    for same in kinds.values():
        yield f"  {len(same)} x {same[0]}"
