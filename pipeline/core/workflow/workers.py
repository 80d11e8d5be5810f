"""Worker processes of this machine: spawned, ended with their parent, deaf to Ctrl-C, which is left to the parent.

`concurrent.futures` starts them and hands out the work. Own is what asks them to stop in good order: without it each
would lose what it has computed since it was last written, up to `journal.WRITING_INTERVAL`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.system.errors import ResourceError
from flexclear.pipeline.core.workflow import cores, stopping

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor


#: what is said of a helper that somebody has killed
LOST = "a helper process was killed; is the memory full? Finished results are stored: run again to go on"


@dataclass(frozen=True)
class Channel:
    """What the workers of a pool share with their parent: the request to stop and its reason, and their progress.

    deaf: how many have a task that cannot leave anything in good order.  reports: arguments of `Monitor.update`; a
    queue without a process or a thread of its own, whose writers wait while it is full.
    """

    stop: Any
    why: Any
    deaf: Any
    reports: Any

    @staticmethod
    def made() -> Channel:
        """A channel for the workers of one pool."""
        context = _context()
        return Channel(context.Event(), context.Array("c", 1000), context.Value("i", 0), context.SimpleQueue())

    def request_stop(self, why: str) -> None:
        """Ask all workers."""
        self.why.value = why.encode()[:999]
        self.stop.set()

    def count_deaf(self) -> None:
        """In a worker: one more."""
        with self.deaf.get_lock():
            self.deaf.value += 1

    def received(self) -> list[Any]:
        """In the parent: what workers have reported since it was last asked."""
        news = []
        while not self.reports.empty():
            news.append(self.reports.get())
        return news


def pool(width: int, channel: Channel | None = None) -> ProcessPoolExecutor:
    """That many workers at most; spawned, because compiled kernels and forks do not mix."""
    # imported here, because a run that finds everything fresh must start quickly
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(width, mp_context=_context(), initializer=_begin, initargs=(channel,))


#: in a worker: that of its pool
_channel: Channel | None = None


def _begin(channel: Channel | None) -> None:
    """In a worker: end when its parent does; Ctrl-C is left to that."""
    global _channel
    _channel = channel
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, daemon=True).start()
    if channel is not None:
        stopping.obey(channel.stop.wait, lambda: channel.why.value.decode(errors="replace"), channel.count_deaf)


def report(name: str, fraction: float | None, text: str) -> None:
    """In a worker: how far the task of this name is, for its parent."""
    if _channel is not None:
        _channel.reports.put((name, fraction, text))


def _watch() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _context() -> Any:
    import multiprocessing

    return multiprocessing.get_context("spawn")


def kill(workers: ProcessPoolExecutor) -> None:
    """End the workers at once; a compiled kernel does not listen to interrupts."""
    for process in list((workers._processes or {}).values()):
        process.kill()
    workers.shutdown(wait=False, cancel_futures=True)


@contextmanager
def lost() -> Iterator[None]:
    """Meanwhile a helper process that somebody kills, as the system does where memory is full, is a limit in words."""
    from concurrent.futures.process import BrokenProcessPool

    try:
        yield
    except (BrokenProcessPool, ConnectionError):
        raise ResourceError(LOST) from None


@dataclass(frozen=True)
class Team:
    """Workers, each started when there is something for it to do, and what they share with their parent."""

    width: int
    pool: ProcessPoolExecutor
    channel: Channel


#: the idle team, stored for the next call
_idle: list[Team] = []
_keeping = 0


@contextmanager
def reused() -> Iterator[None]:
    """Meanwhile workers are not let go between one call of `team` and the next: starting and importing take a second.

    They have the environment of when they were started, so this is for one command.
    """
    global _keeping
    _keeping += 1
    try:
        yield
    finally:
        _keeping -= 1
        while _idle and not _keeping:
            _idle.pop().pool.shutdown()


@contextmanager
def team(width: int) -> Iterator[Team]:
    """Workers, that many at least; killed where the block fails, or ends because all is to stop."""
    with ExitStack() as stack:
        while _idle and _idle[-1].width < width:
            _idle.pop().pool.shutdown()
        # a reused one may serve a wider call next; who is never needed is never started
        mine = _idle.pop() if _idle else _team(max(width, cores.cores()) if _keeping else width)
        stack.callback(kill, mine.pool)
        mine.channel.received()  # of the last call
        yield mine
        if not stopping.requested():
            stack.pop_all()
            if _keeping:
                _idle.append(mine)
            else:
                mine.pool.shutdown()


def _team(width: int) -> Team:
    channel = Channel.made()
    return Team(width, pool(width, channel), channel)


@contextmanager
def without_main() -> Iterator[None]:
    """Workers that are started meanwhile do not run the caller's script again from its top, as they would else."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
