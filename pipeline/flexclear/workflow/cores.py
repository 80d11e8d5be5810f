"""The processors of this machine, and threads of compiled code on those that are free."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import copy_context
from functools import partial
from threading import Event
from typing import TypeVar

from flexclear.system.errors import StoppedError
from flexclear.system.platforms import count_cores
from flexclear.system.progress import Progress, silent

__all__ = ["concurrent_threads", "count_cores", "has_free_processor", "run_in_thread", "set_idle", "side_by_side"]

Result = TypeVar("Result")
#: time of one wait for a thread, after which Ctrl-C is checked [s]: some systems do not interrupt a wait
TICK = 0.1

_others_idle: bool | None = None


def set_idle(others_idle: bool) -> None:
    """Note in a worker, at the start of each task, whether no other task can run at the same time."""
    global _others_idle
    _others_idle = others_idle


def has_free_processor() -> bool:
    """Return True when a processor is free, as far as this program knows; never in another program's workers."""
    known = sys.modules.get("multiprocessing.process")  # loaded in its workers; elsewhere the import would take 4 ms
    idle = (known is None or known.parent_process() is None) if _others_idle is None else _others_idle
    return idle and count_cores() > 1


def concurrent_threads() -> int:
    """Return the number of threads of compiled code to run concurrently."""
    # 4: number of threads while other tasks run, at most the number of cores: these tasks will end and free theirs
    return count_cores() if has_free_processor() else min(count_cores(), 4)


def side_by_side(
    work: Callable[[int, Progress], Result], count: int, done: Callable[[int], None], threads: int = 0
) -> list[Result]:
    """Return the results of work(0) .. work(count - 1) from threads; for compiled code, which runs concurrently.

    work: must call its progress callback from time to time; the call ends it when another thread has failed or Ctrl-C
    was pressed. done: receives the number of finished results. threads: their number; default: `concurrent_threads`.
    Raises the error of the first failure.
    """
    from concurrent.futures import CancelledError, ThreadPoolExecutor

    given_up = Event()

    def progress(fraction: float | None, text: str) -> None:
        if given_up.is_set():
            raise CancelledError

    with ThreadPoolExecutor(min(threads or concurrent_threads(), count)) as pool:
        waiting, results = [pool.submit(copy_context().run, work, k, progress) for k in range(count)], list[Result]()
        try:
            for future in waiting:
                results.append(future.result())
                done(len(results))
        except BaseException as error:
            if not isinstance(error, StoppedError):  # a stop reaches all threads, which end in good order themselves
                given_up.set()
            pool.shutdown(cancel_futures=True)
            raise
    return results


class _GivenUpError(Exception):
    """The result of this work is no longer needed."""


@contextmanager
def run_in_thread(work: Callable[[Progress], Result]) -> Iterator[Callable[[], Result]]:
    """Run work (mostly compiled code) in a thread inside this context; yield the function that waits for its result.

    work: must call its progress callback from time to time, also while it waits; the call ends it when the context has
    failed. Without a free processor or thread, it runs when its result is requested. That function raises its errors.
    """
    from concurrent.futures import ThreadPoolExecutor

    given_up = Event()

    def alive(fraction: float | None, text: str) -> None:
        if given_up.is_set():
            raise _GivenUpError

    result: Callable[[], Result] = partial(work, silent)
    with ThreadPoolExecutor(1) as pool:
        if has_free_processor():
            with suppress(RuntimeError):  # no new thread: limit of a container, or the process is about to end
                result = pool.submit(copy_context().run, work, alive).result
        try:
            yield result
        except BaseException as error:
            if not isinstance(error, StoppedError):  # a stop reaches the work itself, which ends in good order
                given_up.set()
            raise
