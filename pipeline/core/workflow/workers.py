"""Worker processes of this machine: spawned, ended with their parent, deaf to Ctrl-C, which is left to the parent."""

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
class Bell:
    """How workers are asked to stop, and why. deaf: how many have a task that cannot leave anything in good order."""

    rung: Any
    why: Any
    deaf: Any

    @staticmethod
    def made() -> Bell:
        """A bell for the workers of one pool."""
        context = _context()
        return Bell(context.Event(), context.Array("c", 1000), context.Value("i", 0))

    def ring(self, why: str) -> None:
        """Ask all workers."""
        self.why.value = why.encode()[:999]
        self.rung.set()

    def count_deaf(self) -> None:
        """In a worker: one more."""
        with self.deaf.get_lock():
            self.deaf.value += 1


def pool(width: int, bell: Bell | None = None) -> ProcessPoolExecutor:
    """That many workers at most; spawned, because compiled kernels and forks do not mix.

    bell: what asks them to stop in good order.
    """
    # imported here, because a run that finds everything fresh must start quickly
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(width, mp_context=_context(), initializer=_begin, initargs=(bell,))


def _begin(bell: Bell | None) -> None:
    _follow()
    if bell is not None:
        stopping.obey(bell.rung.wait, lambda: bell.why.value.decode(errors="replace"), bell.count_deaf)


def _follow() -> None:
    """In a process that another one started: end when that does; Ctrl-C is left to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, daemon=True).start()


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
    except (BrokenProcessPool, EOFError, ConnectionError):
        raise ResourceError(LOST) from None


@dataclass(frozen=True)
class Team:
    """Workers, what asks them to stop, and the queue of their progress, which a process of its own keeps."""

    width: int
    pool: ProcessPoolExecutor
    bell: Bell
    server: Any
    reports: Any

    @staticmethod
    def begun(width: int) -> Team:
        """That many workers at most; each is started when there is something for it to do."""
        from multiprocessing.managers import SyncManager

        server, bell = SyncManager(ctx=_context()), Bell.made()
        with without_main():
            server.start(_follow)
        return Team(width, pool(width, bell), bell, server, server.Queue())

    def end(self) -> None:
        """Let them go, who have nothing to do any more."""
        self.pool.shutdown()
        self.server.shutdown()

    def kill(self) -> None:
        """End them at once, whatever they do."""
        kill(self.pool)
        self.server.shutdown()


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
            _idle.pop().end()


@contextmanager
def team(width: int) -> Iterator[Team]:
    """Workers, that many at least; killed where the block fails, or ends because all is to stop."""
    with ExitStack() as stack:
        while _idle and _idle[-1].width < width:
            _idle.pop().end()
        # a reused one may serve a wider call next; who is never needed is never started
        with lost():
            mine = _idle.pop() if _idle else Team.begun(max(width, cores.cores()) if _keeping else width)
            stack.callback(mine.kill)
            while not mine.reports.empty():  # of the last call
                mine.reports.get()
        yield mine
        if not stopping.requested():
            stack.pop_all()
            if _keeping:
                _idle.append(mine)
            else:
                mine.end()


@contextmanager
def without_main() -> Iterator[None]:
    """Workers that are started meanwhile do not run the caller's script again from its top, as they would else."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
