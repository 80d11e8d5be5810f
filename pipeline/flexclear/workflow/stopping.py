"""Requests to stop work: by Ctrl-C, by a time limit, by the process that started it.

Work that can leave partial results in good order heeds requests: it checks for them from time to time. All other work
is ended at once.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import LabelledArrays

from flexclear.system.errors import StoppedError

#: reason of a stop by Ctrl-C
INTERRUPTED = "interrupted"

_why = ""
_heeded = 0
_heeded_lock = threading.Lock()
_busy = False
_conditions: list[tuple[Callable[[], bool], str]] = []


def request_stop(why: str) -> None:
    """Ask the work of this process to stop."""
    global _why
    _why = _why or why


def stop_reason() -> str:
    """Return the reason why the work must stop; empty while it may go on."""
    return _why or next((why for due, why in _conditions if due()), "")


def check_stop() -> None:
    """Raise StoppedError when the work must stop."""
    why = stop_reason()
    if why:
        raise stopping_error(why)


def stopping_error(why: str, partial: LabelledArrays | None = None) -> StoppedError:
    """Return the error of work that stops for this reason. partial: arrays of a run up to the stop."""
    return StoppedError(why, partial, interrupted=why == INTERRUPTED)


def heeds_stop_requests() -> bool:
    """Return True when the running work checks for requests."""
    return _heeded > 0


@contextmanager
def heed_requests() -> Iterator[None]:
    """Declare that the work inside this context checks for requests."""
    global _heeded
    with _heeded_lock:  # several threads of a task may integrate at the same time
        _heeded += 1
    try:
        yield
    finally:
        with _heeded_lock:
            _heeded -= 1


@contextmanager
def declare_task() -> Iterator[None]:
    """Declare that this worker has a task inside this context."""
    global _busy
    _busy = True
    try:
        yield
    finally:
        _busy = False


def stop_after(seconds: float | None, why: str) -> AbstractContextManager[None]:
    """Request a stop inside this context after `seconds`; None sets no limit."""
    if seconds is None:
        return nullcontext()
    end = time.monotonic() + seconds
    return stop_when(lambda: time.monotonic() > end, why)


@contextmanager
def stop_when(due: Callable[[], bool], why: str) -> Iterator[None]:
    """Request a stop inside this context once `due` returns True, which is asked often."""
    entry = (due, why)
    _conditions.append(entry)
    try:
        yield
    finally:
        _conditions.remove(entry)


@contextmanager
def request_at_interrupt(say: Callable[[str], None]) -> Iterator[None]:
    """Treat the first Ctrl-C inside this context as a request to work that heeds requests; otherwise interrupt."""
    global _why
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(number: int, frame: Any) -> None:
        if not heeds_stop_requests() or _why:
            raise KeyboardInterrupt
        request_stop(INTERRUPTED)
        say("stopping after storing finished results; press Ctrl-C again to stop at once")

    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    before = None if ignored else signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        _why = ""
        if before is not None:
            signal.signal(signal.SIGINT, before)


def obey_parent(wait_for_signal: Callable[[], Any], why: Callable[[], str], unstoppable: Callable[[], None]) -> None:
    """Let a worker stop when its parent requests it; `unstoppable` reports a task that does not heed requests."""

    def wait() -> None:
        wait_for_signal()
        request_stop(why())
        if _busy and not heeds_stop_requests():
            unstoppable()

    threading.Thread(target=wait, daemon=True).start()
