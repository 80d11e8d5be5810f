"""``flexclear sweep``: many points of one scene, each stored as soon as it is done."""

from __future__ import annotations

import argparse
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
from flexclear.artifacts.store import disk_limits, publish, write_dataset
from flexclear.commands import export, scenes
from flexclear.commands.export import as_json
from flexclear.scene.load import is_file, load_scene, scene_name
from flexclear.scene.schema import Scene
from flexclear.scene.sweep import Sweep, load_sweep, read_sweep
from flexclear.stages.sweeps import sweep_large, sweep_plan
from flexclear.stages.sweeps.sweep_engine import Engine, Job, engine
from flexclear.stages.workplace import Workplace, add_options, open_workplace, relative
from flexclear.system.errors import InputError, SolverError
from flexclear.workflow import cores

#: name of the shown files, without their endings
NAME = "sweep"
#: name of a sweep without a file
UNNAMED = "sweep"
#: finished points are stored after so many seconds, later after that fraction of the time so far
OFTEN, FRACTION = 2.0, 0.01


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument("sweeps", nargs="+", metavar="SWEEP", help="a sweep file, or a name below scenes/")
    add_options(parser, "usual", "json")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster with this scheduler instead")
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help=f"copy the dataset here (one sweep): {export.KNOWN}, .zarr"
    )


def command(options: argparse.Namespace) -> None:
    """Bring sweeps up to date: dataset and figures below results/sweeps, a summary on the screen."""
    if options.out is not None and len(options.sweeps) == 1 and options.out.suffix == sweep_large.SUFFIX:
        sweep_large.require_zarr(f"--out {options.out}")
    else:
        scenes.check_out(options.out, options.sweeps, "sweep", (*export.NEEDS, sweep_large.SUFFIX))
    workplace = open_workplace(options)
    paths = [scenes.find_scene(name) for name in options.sweeps]
    requested = [
        sweep_plan.plan(sweep, scene, str(path)) for path in paths for sweep, scene in [read(path, options.set)]
    ]
    if options.out is not None and options.out.suffix != sweep_large.SUFFIX and sweep_large.is_large(requested[0]):
        raise InputError(f"--out {options.out}", "the dataset is larger than memory", "let its name end in .zarr")
    made = {}
    with engine(width(options.jobs), options.scheduler) as workers, workplace.limited():
        for path, plan in zip(paths, requested, strict=True):
            name = scenes.with_edits(scene_name(path).removeprefix("sweeps/"), options.set)
            made[name] = bring(plan, workers, workplace, folder := workplace.store.root / "sweeps" / name)
            _show(plan, made[name], folder, options.out, quiet=options.json)
    if options.json:
        print(as_json(made))


def width(asked: int | None) -> int:
    """Return the number of workers; InputError for a number below one."""
    if asked is not None and asked < 1:
        raise InputError("--jobs", f"must be at least 1, not {asked}", "leave it out to use every core")
    return asked or cores.cores()


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
        return bring(plan, runner, open_workplace())


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
        self.done |= {job.key: sweep_large.stripped(point) if self.large else point for job, point in finished}
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


def bring(plan: sweep_plan.Plan, workers: Engine, workplace: Workplace, folder: Path | None = None) -> xr.Dataset:
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
                result = sweep_large.written(ready, workplace.store, sink.done, folder / f"{NAME}{sweep_large.SUFFIX}")
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


def _show(plan: sweep_plan.Plan, result: xr.Dataset, folder: Path, out: Path | None, *, quiet: bool = False) -> None:
    """Write figures next to the dataset, and print a summary unless `quiet`."""
    from flexclear.post.overview.sweep_figures import figures

    file = next(
        path for path in (folder / f"{NAME}{suffix}" for suffix in (sweep_large.SUFFIX, ".nc")) if path.exists()
    )
    drawn = figures(result) if file.suffix != sweep_large.SUFFIX else {}
    for name, content in drawn.items():
        publish(folder / name, content)
    for path in folder.glob(f"{NAME}.*g"):
        if path.name not in drawn:  # from an earlier state of the sweep
            path.unlink()
    if out is not None and out.suffix == sweep_large.SUFFIX:
        sweep_large.write_copy(out, result)
    elif out is not None:
        with disk_limits(out.parent):
            export.write(result, out, result["status"].dims)
    if not quiet:
        print("\n".join(summary(plan, result, file)))
    if not (result["status"] == 0).any():
        raise SolverError(f"{plan.sweep.name}: every point was refused; see the reasons above")


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
