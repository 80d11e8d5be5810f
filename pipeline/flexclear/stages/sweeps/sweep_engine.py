"""Executors of sweeps: this process, the cores of this machine, or a Dask cluster, with equal results."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import ceil, inf
from typing import Any

from flexclear.artifacts.points import Point
from flexclear.stages.sweeps.sweep_points import source_digest, work
from flexclear.system.errors import InputError, ResourceError
from flexclear.workflow import stopping, workers
from flexclear.workflow.schedule import TICK

#: seconds of work in a batch, largest number of points in a batch, submitted batches per worker
BATCH_SECONDS, MOST_POINTS, QUEUED = 0.5, 1000, 2
#: least evaluations of a point that is run together with others, and of all waiting points that are worth compiling for
WORTH_TOGETHER, WORTH_CODE = 5_000, 5_000_000
#: points evaluated together, where each worker gets as many; seconds of work in their batches, long enough for several
#: groups, since each group waits for its last point
POINTS_TOGETHER, BATCH_SECONDS_TOGETHER = 8, 5.0
#: seconds within which a scheduler must answer
SCHEDULER_TIMEOUT = 10.0
#: losses of worker processes in a row after which the sweep stops
MOST_LOSSES = 3


@dataclass(frozen=True)
class Job:
    """A point to run. family: key of its family; point: key path in the scene -> value."""

    key: str
    family: str
    point: dict[str, Any]


Done = Callable[[Sequence[tuple[Job, Point]], float], None]
Points = list[dict[str, Any]]
#: submits `stages.sweeps.sweep_points.work` with its first five arguments
Submit = Callable[[str, bytes, Points, bool, bool], Future[Any]]


@dataclass(frozen=True)
class Engine:
    """Executor of a sweep; `width` returns how many tasks run at a time, `here` is True on this machine.

    renew: called after a dying worker has broken the process pool, before work is submitted again.
    """

    submit: Submit
    width: Callable[[], int]
    here: bool = True
    renew: Callable[[], None] = lambda: None

    def run(self, jobs: Sequence[Job], families: dict[str, bytes], done: Done) -> None:
        """Run points; `done` receives finished points and their processor time [s], batches in any order.

        families: the argument `packed` of `stages.sweeps.sweep_points.work`, by family. Raises ResourceError when
        workers keep dying, StoppedError when the work is to stop.
        """
        waiting, running, seconds_each, lost = _by_family(jobs), dict[Future[Any], list[Job]](), 0.0, 0
        evaluations, together = 0.0, False  # evaluations per point in the last batch; whether points are run together
        while waiting or running:
            stopping.check_stop()
            # only the first point runs until it is finished, so that no kernel is compiled twice
            width = self.width()
            while waiting and len(running) < (QUEUED * width if seconds_each else 1):
                left = sum(map(len, waiting))
                enough = together or (left >= POINTS_TOGETHER * width and left * evaluations >= WORTH_CODE)
                together = evaluations >= WORTH_TOGETHER and enough
                mine = _take(waiting, _portion(left, seconds_each, width, together) if seconds_each else 1)
                running[self._submit_safely(mine, families, others_idle=not seconds_each, together=together)] = mine
            finished, _ = wait(running, timeout=TICK, return_when=FIRST_COMPLETED)
            for future in finished:
                mine = running.pop(future)
                try:
                    points, seconds = future.result()
                except BrokenProcessPool:
                    # the batch at fault is unknown, and all running batches are lost: each is run again
                    again = [mine, *running.values()]
                    running.clear()
                    lost += 1
                    if lost > MOST_LOSSES:
                        raise ResourceError(f"{lost} times in a row {workers.LOST}") from None
                    waiting += [list(reversed(batch)) for batch in again]
                    self.renew()
                    break
                done(list(zip(mine, points, strict=True)), seconds)
                evaluations = sum(point.evaluations for point in points) / len(points)
                first, lost = not seconds_each, 0  # the first batch's time includes compiling and fetching
                seconds_each = max(1e-6, seconds / len(mine)) if not first else BATCH_SECONDS / 2.0

    def _submit_safely(
        self, mine: list[Job], families: dict[str, bytes], *, others_idle: bool, together: bool
    ) -> Future[Any]:
        family, points = mine[0].family, [job.point for job in mine]
        try:
            return self.submit(family, families[family], points, others_idle, together)
        except (BrokenProcessPool, ConnectionError, EOFError) as error:  # the latter two: worker killed at its start
            if not self.here:
                raise
            failed: Future[Any] = Future()
            failed.set_exception(BrokenProcessPool(str(error)))
            return failed


def _by_family(jobs: Sequence[Job]) -> list[list[Job]]:
    """Return the jobs in lists of one family each, in reversed order, as `_take` takes from the end."""
    families: dict[str, list[Job]] = {}
    for job in jobs:
        families.setdefault(job.family, []).append(job)
    return [list(reversed(mine)) for mine in reversed(families.values())]


def _portion(left: int, seconds_each: float, width: int, together: bool) -> int:
    """Return the number of points in the next batch. left: waiting points; seconds_each: processor time of each [s].

    together: whether points are evaluated together; with few in a batch, most would wait for the last point.
    """
    # 5e-3: least seconds of work in a batch per worker: many workers with less would exceed the scheduler's capacity
    asking = 5e-3 * width
    seconds_of_work = BATCH_SECONDS_TOGETHER if together else BATCH_SECONDS
    # 0.02: least seconds of work in a batch: towards the end batches shrink with the remaining work, so that all
    # workers finish together
    seconds = min(max(seconds_of_work, asking), max(0.02, asking, left * seconds_each / (QUEUED * width)))
    if together and left < POINTS_TOGETHER * width:  # the last points
        return max(POINTS_TOGETHER // 2, ceil(left / width))
    if together:
        return POINTS_TOGETHER * min(
            MOST_POINTS // POINTS_TOGETHER, max(1, round(seconds / seconds_each / POINTS_TOGETHER))
        )
    return min(MOST_POINTS, max(1, int(seconds / seconds_each)))


def _take(waiting: list[list[Job]], count: int) -> list[Job]:
    stretch = waiting[-1]
    taken = [stretch.pop() for _ in range(min(count, len(stretch)))]
    if not stretch:
        waiting.pop()
    return taken


@contextmanager
def engine(width: int, scheduler: str | None) -> Iterator[Engine]:
    """Yield the executor of a sweep: a Dask cluster at an address, `width` processes here, or this process."""
    if scheduler is not None:
        with _cluster(scheduler) as runner:
            yield runner
        return
    if width == 1:
        yield Engine(_here, lambda: 1)
        return
    pools: list[ProcessPoolExecutor] = [workers.pool(width)]

    def submit(family: str, packed: bytes, *rest: Any) -> Future[Any]:
        return pools[-1].submit(work, family, packed, *rest)

    def renew() -> None:
        workers.kill_workers(pools[-1])
        pools.append(workers.pool(width))

    try:
        yield Engine(submit, lambda: width, renew=renew)
    except BaseException:
        workers.kill_workers(pools[-1])
        raise
    pools[-1].shutdown()


def _here(*given: Any) -> Future[Any]:
    """Call `work` in this process at once; return its result as a finished future."""
    future: Future[Any] = Future()
    future.set_result(work(*given))
    return future


@contextmanager
def _cluster(address: str) -> Iterator[Engine]:
    """Yield the workers of a Dask scheduler; raise InputError without workers, or when workers run other sources."""
    where = f"--scheduler {address}"
    try:
        from distributed import Client, KilledWorker
        from distributed.client import FutureCancelledError
        from distributed.comm import CommClosedError
    except ImportError:
        raise InputError(where, "dask.distributed is not installed", "pip install 'flexclear[cluster]'") from None
    stack = ExitStack()
    stack.enter_context(_quiet("distributed"))
    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
        stack.callback(client.close)
    except (OSError, ValueError, TimeoutError) as error:
        stack.close()
        raise InputError(
            where, f"no scheduler answers there ({type(error).__name__})", "start one with `dask scheduler`"
        ) from None
    try:
        yield _on_cluster(client, where)
    except KilledWorker as error:
        text = f"{where}: workers died again and again over a task ({error}); is their memory full?"
        raise ResourceError(text) from None
    except (CancelledError, FutureCancelledError, CommClosedError):
        raise ResourceError(f"{where}: the scheduler stopped; finished results are stored") from None
    except ImportError as error:  # from a worker that joined after the check
        raise InputError(where, f"a worker cannot import flexclear: {error}", "install it where it runs") from None
    finally:
        stack.close()


@contextmanager
def _quiet(library: str) -> Iterator[None]:
    """Silence the loggers of a library: its failures are reported in one sentence, without tracebacks."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == library]
    levels = {logger: logger.level for logger in map(logging.getLogger, names)}
    for logger in levels:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)


def _on_cluster(client: Any, where: str) -> Engine:
    """Return the executor of a cluster; its scheduler reruns points that are lost with a worker."""
    executor, last_poll = client.get_executor(), [time.monotonic(), _threads(client, where)]
    held: dict[str, Any] = {}

    def submit(family: str, packed: bytes, *rest: Any) -> Future[Any]:
        # sent once; workers fetch it from each other, and the scheduler recreates it when it is lost with a worker
        if family not in held:
            held[family] = client.submit(bytes, packed, key=f"family-{family}", pure=False)
        future: Future[Any] = executor.submit(work, family, held[family], *rest, source_digest())
        return future

    def width() -> int:
        """Return the current number of threads; workers may join and leave."""
        # 5.0: interval at which a cluster is asked for its number of workers [s]
        if time.monotonic() - last_poll[0] > 5.0:
            last_poll[:] = time.monotonic(), sum(client.nthreads().values())
        return max(1, int(last_poll[1]))

    return Engine(submit, width, here=False)


def _threads(client: Any, where: str) -> int:
    """Return how many tasks the workers run at a time.

    Raises InputError when there are no workers or they run other sources, ResourceError when a worker does not answer.
    """
    end = inf
    while True:
        threads = sum(client.nthreads().values())
        if not threads:
            raise InputError(where, "the scheduler has no workers", "start some with `dask worker ADDRESS`")
        digests = client.run(source_digest, on_error="return")
        for worker, digest in digests.items():
            if isinstance(digest, ImportError):
                raise InputError(
                    where, f"worker {worker} cannot import flexclear: {digest}", "install it where it runs"
                )
        failed = {worker: error for worker, error in digests.items() if isinstance(error, Exception)}
        if not failed:
            break
        end = min(
            end, time.monotonic() + SCHEDULER_TIMEOUT
        )  # from the first failure on: the check itself may have waited for a worker
        if time.monotonic() > end:
            worker, error = next(iter(failed.items()))
            raise ResourceError(f"{where}: worker {worker} does not answer ({error}); is its memory full?")
        time.sleep(TICK)  # the scheduler removes workers that have died, and the others are asked again
    others = [worker for worker, digest in digests.items() if digest != source_digest()]
    if others:
        raise InputError(where, f"worker {others[0]} runs different sources of flexclear", "install the same version")
    return int(threads)
