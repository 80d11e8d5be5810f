"""What only some systems tell and limit: the processor time of child processes, and what a process may take.

Windows has no module `resource`. What needs it refuses there in words (`lacking`), and nothing else does.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any


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


def children(process: int) -> list[int]:
    """Numbers of the processes that a process has started and that still run (Linux); none elsewhere.

    Python's own tracker of semaphores is left out: without it nothing is lost, but Python prints tracebacks at its end.
    So are processes that still have their parent's command line: any of them may become the tracker.
    """
    numbers, own = list[int](), _command_line(process)
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            started = map(int, task.read_text(encoding="utf-8").split())
            lines = {n: _command_line(n) for n in started}
            numbers += [n for n, line in lines.items() if line not in (b"", own) and b"resource_tracker" not in line]
    return numbers


def _command_line(process: int) -> bytes:
    """Empty where the process has ended."""
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes()
    except OSError:
        return b""


def seconds_of(process: int) -> float:
    """Processor time that a process has used [s] (Linux); 0 where it has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def kill(process: int) -> None:
    """End a process as the system does where memory is full; nothing where it has ended."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)


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
