"""The processors of this machine, and whether one of them is free."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import copy_context
from functools import partial
from threading import Event
from typing import TypeVar

from flexclear.pipeline.core.system.errors import StoppedError
from flexclear.pipeline.core.system.platforms import cores
from flexclear.pipeline.core.system.progress import Progress, silent

__all__ = ["cores", "free", "meanwhile", "set_idle", "side_by_side", "width"]

Result = TypeVar("Result")
#: how long a thread is awaited before this one listens to the keyboard [s]: some systems interrupt no wait
TICK = 0.1
#: threads while other tasks run, which will end and leave their cores: so many, where there are as many cores
THREADS_WHILE_BUSY = 4

_others_idle: bool | None = None


def set_idle(others_idle: bool) -> None:
    """In a worker, with each task: whether nothing else can run while it does."""
    global _others_idle
    _others_idle = others_idle


def free() -> bool:
    """Whether a processor is free, for all that this program knows; in workers of another program none is."""
    known = sys.modules.get("multiprocessing.process")  # its workers have imported it; others need not, for 4 ms
    idle = (known is None or known.parent_process() is None) if _others_idle is None else _others_idle
    return idle and cores() > 1


def width() -> int:
    """How many threads of compiled code to run side by side."""
    return cores() if free() else min(cores(), THREADS_WHILE_BUSY)


def side_by_side(
    work: Callable[[int, Progress], Result], count: int, done: Callable[[int], None], threads: int = 0
) -> list[Result]:
    """Results of work(0) .. work(count - 1), made in threads: for what is mostly compiled code, which lets others run.

    work: is given a progress to call now and then, which ends it when another one has failed or Ctrl-C was pressed.
    done: receives the number of finished ones.  threads: how many; `width` by default.  Raises the error of the first
    one that failed.
    """
    from concurrent.futures import CancelledError, ThreadPoolExecutor

    given_up = Event()

    def progress(fraction: float | None, text: str) -> None:
        if given_up.is_set():
            raise CancelledError

    with ThreadPoolExecutor(min(threads or width(), count)) as pool:
        waiting, results = [pool.submit(copy_context().run, work, k, progress) for k in range(count)], list[Result]()
        try:
            for future in waiting:
                results.append(future.result())
                done(len(results))
        except BaseException as error:
            if not isinstance(error, StoppedError):  # of that all hear, and leave their work in good order
                given_up.set()
            pool.shutdown(cancel_futures=True)
            raise
    return results


class _GivenUpError(Exception):
    """Nobody waits for this work any more."""


@contextmanager
def meanwhile(work: Callable[[Progress], Result]) -> Iterator[Callable[[], Result]]:
    """Meanwhile a thread does some work that is mostly compiled code; gives what waits for its result.

    work: is given a progress to call now and then, and while it waits, which ends it when what continues next to it has
    failed.  Where no processor is free, or no thread is to be had, it is done when its result is asked for.  What waits
    raises what the work raised.
    """
    from concurrent.futures import ThreadPoolExecutor

    given_up = Event()

    def alive(fraction: float | None, text: str) -> None:
        if given_up.is_set():
            raise _GivenUpError

    result: Callable[[], Result] = partial(work, silent)
    with ThreadPoolExecutor(1) as pool:
        if free():
            with suppress(RuntimeError):  # no thread: a limit of a container, or the process is about to end
                result = pool.submit(copy_context().run, work, alive).result
        try:
            yield result
        except BaseException as error:
            if not isinstance(error, StoppedError):  # of that the work hears itself, and leaves all in good order
                given_up.set()
            raise
