"""Work that is asked to stop: by Ctrl-C, by a limit of time, by the process that started it.

What can leave its work half done in good order heeds requests and searches for them now and then; all else is ended at
once.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from flexclear.pipeline.core.system.errors import StoppedError

#: why work stops
INTERRUPTED = "interrupted"

_why = ""
_heeded = 0
_counting = threading.Lock()
_busy = False
_deadlines: list[tuple[float, str]] = []


def request(why: str) -> None:
    """Ask the work of this process to stop."""
    global _why
    _why = _why or why


def requested() -> str:
    """Why the work is to stop; empty when it is not."""
    now = time.monotonic()
    return _why or next((why for end, why in _deadlines if now > end), "")


def check() -> None:
    """Raise StoppedError when the work is to stop."""
    why = requested()
    if why:
        raise StoppedError(why, interrupted=why == INTERRUPTED)


def heeds() -> bool:
    """Whether what runs now searches for requests."""
    return _heeded > 0


@contextmanager
def heeded() -> Iterator[None]:
    """Meanwhile requests are searched for."""
    global _heeded
    with _counting:  # threads of one task may all integrate
        _heeded += 1
    try:
        yield
    finally:
        with _counting:
            _heeded -= 1


@contextmanager
def busy() -> Iterator[None]:
    """Meanwhile this worker has a task."""
    global _busy
    _busy = True
    try:
        yield
    finally:
        _busy = False


@contextmanager
def until(seconds: float | None, why: str) -> Iterator[None]:
    """Meanwhile work is to stop when that time is over."""
    if seconds is None:
        yield
        return
    entry = (time.monotonic() + seconds, why)
    _deadlines.append(entry)
    try:
        yield
    finally:
        _deadlines.remove(entry)


@contextmanager
def gently(say: Callable[[str], None]) -> Iterator[None]:
    """Meanwhile the first Ctrl-C is a request, where requests are heeded; else, and the second time, it ends all."""
    global _why
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: Any) -> None:
        if not heeds() or _why:
            raise KeyboardInterrupt
        request(INTERRUPTED)
        say("stopping in good order; Ctrl-C again ends at once")

    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    before = None if ignored else signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        _why = ""
        if before is not None:
            signal.signal(signal.SIGINT, before)


def obey(wait_for_signal: Callable[[], Any], why: Callable[[], str], deaf: Callable[[], None]) -> None:
    """In a worker: stop when the parent says so; `deaf` informs it of a task that does not heed requests."""

    def wait() -> None:
        wait_for_signal()
        request(why())
        if _busy and not heeds():
            deaf()

    threading.Thread(target=wait, daemon=True).start()
