"""What only some systems tell and limit: the processor time of child processes, and what a process may take.

Windows has no module `resource`. What needs it refuses there in words (`lacking`), and nothing else does.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import psutil


def lacking() -> str:
    """Why child processes can be neither measured nor limited here; empty where they can."""
    try:
        known = find_spec("resource") is not None
    except ValueError:  # its import is blocked
        known = False
    return "" if known else "needs processor times and limits of child processes, which this system does not have"


def _resource() -> Any:
    return import_module("resource")


def seconds_of_children() -> float:
    """Processor time of all child processes that ended so far [s], with theirs."""
    used = _resource().getrusage(_resource().RUSAGE_CHILDREN)
    return float(used.ru_utime + used.ru_stime)


def limit_seconds(seconds: int | None) -> None:
    """Let this process take so much more processor time [s], whole seconds; None: as much as it may."""
    resource = _resource()
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    used = resource.getrusage(resource.RUSAGE_SELF)
    soft = hard if seconds is None else int(used.ru_utime + used.ru_stime) + seconds
    resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))


def limit_files(size: int) -> Callable[[], None]:
    """What lets a process write no file longer than so many bytes."""
    resource = _resource()
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def children(process: int) -> list[psutil.Process]:
    """The processes that a process has started and that still run; none where it has ended.

    Python's own tracker of semaphores is left out: without it nothing is lost, but Python prints tracebacks at its end.
    So are processes that still have their parent's command line: any of them may become the tracker.
    """
    running = list[psutil.Process]()
    with suppress(psutil.Error):
        parent = psutil.Process(process)
        own = parent.cmdline()
        for child in parent.children():
            with suppress(psutil.Error):
                line = child.cmdline()
                if line not in ([], own) and "resource_tracker" not in " ".join(line):
                    running.append(child)
    return running


def seconds_of(process: psutil.Process) -> float:
    """Processor time that a process has used [s]; 0 where it has ended."""
    try:
        times = process.cpu_times()
    except psutil.Error:
        return 0.0
    return float(times.user + times.system)


def ended_by(exit_code: int) -> str:
    """Name of the signal that ended a process, such as SIGSEGV; empty when it was none.

    Real-time signals but the first and the last have no name: they are known by their number.
    """
    if exit_code >= 0:
        return ""
    try:
        return signal.Signals(-exit_code).name
    except ValueError:
        return f"signal {-exit_code}"
