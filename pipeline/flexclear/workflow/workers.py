"""Worker processes of this machine: spawned, ended with their parent; Ctrl-C and SIGTERM are left to the parent.

`concurrent.futures` starts them and distributes the work. This module adds the request to stop in good order: without
it each worker would lose all results since its last writing, up to `journal.WRITING_INTERVAL`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from flexclear.system.errors import InputError, ResourceError
from flexclear.workflow import cores, stopping

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor


#: message about a worker process that was killed, or that runs a script again: each imports its parent's main module
LOST = (
    "a helper process was killed; is the memory full, or does the calling script lack `if __name__ == '__main__':`? "
    "Finished results are stored: run again to continue"
)


@dataclass(frozen=True)
class Channel:
    """Data shared by the workers of a pool and their parent: the request to stop with its reason, and progress.

    ends: of a pipe, for workers without the second one; closing that one requests the stop. An event would wait for
    workers that were killed while they waited for it.
    unstoppable: number of workers whose task cannot stop in good order. reports: arguments of `Monitor.update`; a queue
    without a process or thread of its own, whose writers wait while it is full.
    """

    ends: tuple[Any, ...]
    why: Any
    unstoppable: Any
    reports: Any

    @staticmethod
    def create() -> Channel:
        """Create a channel for the workers of one pool."""
        context = _context()
        return Channel(
            context.Pipe(duplex=False), context.Array("c", 1000), context.Value("i", 0), context.SimpleQueue()
        )

    def request_stop(self, why: str) -> None:
        """Ask all workers to stop."""
        self.why.value = why.encode()[:999]
        self.ends[1].close()

    def await_stop(self) -> None:
        """Wait, in a worker, until the parent asks it to stop or ends."""
        with suppress(EOFError, OSError):
            self.ends[0].poll(None)

    def count_unstoppable(self) -> None:
        """Count this worker as one whose task does not heed requests."""
        with self.unstoppable.get_lock():
            self.unstoppable.value += 1

    def take_reports(self) -> list[Any]:
        """Return, in the parent, the reports of workers since the last call."""
        news = []
        while not self.reports.empty():
            news.append(self.reports.get())
        return news


def require_guard() -> None:
    """Raise InputError in a worker that, while it starts, runs calls of its parent's script again."""
    # `multiprocessing` calls the script `__mp_main__` while it runs, and `__main__` as well once it has ended
    again = sys.modules.get("__mp_main__")
    if again is not None and again is not sys.modules["__main__"]:
        raise InputError(
            "the calling script",
            "runs again in each of its processes",
            "put its calls below `if __name__ == '__main__':`",
        )


def pool(width: int, channel: Channel | None = None) -> ProcessPoolExecutor:
    """Return a pool of at most `width` workers; spawned, because compiled kernels and forks do not mix."""
    # imported here, because a command whose results are all up to date must start quickly
    from concurrent.futures import ProcessPoolExecutor

    given = channel and replace(channel, ends=channel.ends[:1])
    return ProcessPoolExecutor(width, mp_context=_context(), initializer=_prepare_worker, initargs=(given,))


#: in a worker: the channel of its pool
_channel: Channel | None = None


def _prepare_worker(channel: Channel | None) -> None:
    """Prepare a worker: it ends with its parent, and ignores Ctrl-C and SIGTERM, which the parent handles.

    Shells, schedulers of clusters and services send both to all processes of a command.
    """
    global _channel
    _channel = channel
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_watch_parent, daemon=True).start()
    if channel is not None:
        stopping.obey_parent(
            channel.await_stop, lambda: channel.why.value.decode(errors="replace"), channel.count_unstoppable
        )


def report(name: str, fraction: float | None, text: str) -> None:
    """Report from a worker to its parent how far the task of this name is."""
    if _channel is not None:
        _channel.reports.put((name, fraction, text))


def _watch_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _context() -> Any:
    import multiprocessing

    return multiprocessing.get_context("spawn")


def kill_workers(workers: ProcessPoolExecutor) -> None:
    """End the workers at once; a compiled kernel does not react to interrupts."""
    for process in list((workers._processes or {}).values()):
        process.kill()
    workers.shutdown(wait=False, cancel_futures=True)


@contextmanager
def report_lost_worker() -> Iterator[None]:
    """Convert the loss of a worker process, which the system may kill when memory is full, to a ResourceError."""
    from concurrent.futures.process import BrokenProcessPool

    try:
        yield
    except (BrokenProcessPool, ConnectionError):
        raise ResourceError(LOST) from None


@dataclass(frozen=True)
class Team:
    """Workers, each started when it is first needed, and the channel that they share with their parent."""

    width: int
    pool: ProcessPoolExecutor
    channel: Channel


#: the idle team, held for the next call
_idle: list[Team] = []
_reusing = 0


@contextmanager
def keep_workers() -> Iterator[None]:
    """Keep workers alive between calls of `worker_team` inside this context: starting and importing take a second.

    Workers have the environment of their start, so a context is for one command.
    """
    global _reusing
    _reusing += 1
    try:
        yield
    finally:
        _reusing -= 1
        while _idle and not _reusing:
            _idle.pop().pool.shutdown()


@contextmanager
def worker_team(width: int) -> Iterator[Team]:
    """Yield at least `width` workers; they are killed where the block fails or the work must stop."""
    with ExitStack() as stack:
        while _idle and _idle[-1].width < width:
            _idle.pop().pool.shutdown()
        # a team for reuse may serve a wider call later; workers that are never needed are never started
        current = _idle.pop() if _idle else _start_team(max(width, cores.count_cores()) if _reusing else width)
        stack.callback(kill_workers, current.pool)
        current.channel.take_reports()  # discards reports of the last call
        yield current
        if not stopping.stop_reason():
            stack.pop_all()
            if _reusing:
                _idle.append(current)
            else:
                current.pool.shutdown()


def _start_team(width: int) -> Team:
    channel = Channel.create()
    return Team(width, pool(width, channel), channel)
