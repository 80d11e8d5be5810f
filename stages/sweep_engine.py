"""Who runs the points of a sweep: this process, the cores of this machine, or a Dask cluster; with equal results."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.artifacts.points import Point
from flexclear.pipeline.core.errors import InputError, ResourceError
from flexclear.pipeline.core.workflow import stopping, workers
from flexclear.pipeline.core.workflow.schedule import TICK
from flexclear.stages.sweep_points import source_digest, work

#: seconds of work that are handed out at a time, most points of it, and how much of it waits for each worker
SHARE, MOST, QUEUED = 0.5, 1000, 2
#: points that take longer [s] keep their unfinished work; of others nothing is worth the writing
LONG = 5.0
#: seconds in which a scheduler must have answered
PATIENCE = 10.0


@dataclass(frozen=True)
class Job:
    """A point to be run. family: its key; point: place of the scene -> value; journal: where it keeps its work."""

    key: str
    family: str
    point: dict[str, Any]
    journal: Path


Done = Callable[[Sequence[tuple[Job, Point]], float], None]


@dataclass(frozen=True)
class Engine:
    """An executor (None: this process), and how many tasks it works on at a time; whether on this machine."""

    executor: Executor | None
    width: int
    here: bool = True

    def run(self, jobs: Sequence[Job], families: dict[str, bytes], done: Done) -> None:
        """Run points; `done` is told finished ones and their processor time [s], in any order of the batches.

        families: what `stages.sweep_points.work` is given of each.  Raises StoppedError when all is to stop.
        """
        waiting, running, pace = _by_family(jobs), dict[Future[Any], list[Job]](), 0.0
        while waiting or running:
            stopping.check()
            # nothing is compiled twice: until the first point is there nothing else begins
            while waiting and len(running) < (QUEUED * self.width if pace else 1):
                count = min(MOST, max(1, int(SHARE / pace))) if pace else 1
                mine = _take(waiting, count)
                future = self._submit(mine, families, alone=not pace, keep=self.here and not 0.0 < pace < LONG)
                running[future] = mine
            finished, _ = wait(running, timeout=TICK, return_when=FIRST_COMPLETED)
            for future in finished:
                mine = running.pop(future)
                points, seconds = _result(future)
                done(list(zip(mine, points, strict=True)), seconds)
                first = not pace  # what it took held compiling and fetching
                pace = max(1e-6, seconds / len(mine)) if not first else SHARE / 2.0

    def _submit(self, mine: list[Job], families: dict[str, bytes], *, alone: bool, keep: bool) -> Future[Any]:
        family, points = mine[0].family, [job.point for job in mine]
        journals = [job.journal if keep else None for job in mine]
        if self.executor is None:
            future: Future[Any] = Future()
            future.set_result(work(family, families[family], points, alone, journals))
            return future
        with workers.without_main():
            return self.executor.submit(work, family, families[family], points, alone, journals)


def _by_family(jobs: Sequence[Job]) -> list[list[Job]]:
    """Jobs in stretches of one family, the next one last."""
    found: dict[str, list[Job]] = {}
    for job in jobs:
        found.setdefault(job.family, []).append(job)
    return [list(reversed(mine)) for mine in reversed(found.values())]


def _take(waiting: list[list[Job]], count: int) -> list[Job]:
    stretch = waiting[-1]
    taken = [stretch.pop() for _ in range(min(count, len(stretch)))]
    if not stretch:
        waiting.pop()
    return taken


def _result(future: Future[Any]) -> tuple[list[Point], float]:
    try:
        found: tuple[list[Point], float] = future.result()
    except BrokenProcessPool:
        raise ResourceError("a worker process was killed; is the memory full?") from None
    return found


@contextmanager
def engine(width: int, scheduler: str | None) -> Iterator[Engine]:
    """The engine of a sweep: a Dask cluster at an address, that many processes here, or this one."""
    if scheduler is not None:
        with _cluster(scheduler) as found:
            yield found
        return
    if width == 1:
        yield Engine(None, 1)
        return
    pool: ProcessPoolExecutor = workers.pool(width)
    try:
        yield Engine(pool, width)
    except BaseException:
        workers.kill(pool)
        raise
    pool.shutdown()


@contextmanager
def _cluster(address: str) -> Iterator[Engine]:
    """The workers of a Dask scheduler; InputError when there are none, or they run other sources."""
    place = f"--scheduler {address}"
    try:
        from distributed import Client
    except ImportError:
        raise InputError(place, "dask.distributed is not installed", "pip install 'flexclear[cluster]'") from None
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            place, f"no scheduler answers there ({type(error).__name__})", "start one with `dask scheduler`"
        ) from None
    try:
        yield Engine(client.get_executor(), _threads(client, place), here=False)
    finally:
        client.close()


def _threads(client: Any, place: str) -> int:
    """Tasks that the workers run at a time."""
    threads = sum(client.nthreads().values())
    if not threads:
        raise InputError(place, "the scheduler has no workers", "start some with `dask worker ADDRESS`")
    try:
        found = client.run(source_digest)
    except ImportError as error:
        raise InputError(place, f"its workers cannot import flexclear: {error}", "install it where they run") from None
    others = [worker for worker, digest in found.items() if digest != source_digest()]
    if others:
        raise InputError(place, f"worker {others[0]} runs other sources of flexclear", "install the same ones there")
    return threads


def now() -> float:
    """Clock for rates [s]."""
    return time.monotonic()
