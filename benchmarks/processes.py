"""Worker processes that take work in turn; a process that takes too long or dies is replaced, which is an outcome.

Windows has no module `resource`. Families that measure or limit child processes do not run there (`lacking`).
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import connection, get_context
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import psutil

from benchmarks.family import WRONG, Case, Record

Work = Callable[[Any, Callable[[], None]], Any]
#: longest wait for an answer, as a multiple of the limit of processor time: a sleeping process uses none
PATIENCE = 10


class LostError(Exception):
    """Raised when a process gives no answer.  seconds: processor time of its case [s] where known, else 0."""

    def __init__(self, reason: str, seconds: float = 0.0) -> None:
        super().__init__(reason)
        self.seconds = seconds


def outcomes(cases: Sequence[Case], jobs: int, work: Work, limit: int) -> Iterator[tuple[Case, Record]]:
    """Yield every case with its record, in order of completion; `work` gets `case.of` as parameters (see `Worker`)."""
    workers = [Worker(work, limit) for _ in range(min(jobs, len(cases)))]
    idle: SimpleQueue[int] = SimpleQueue()

    def record(case: Case) -> Record:
        number = idle.get()
        try:
            found: Record = workers[number].ask(case.of)
        except LostError as lost:
            found = {"verdict": WRONG, "reason": str(lost), "seconds": lost.seconds}
            workers[number] = Worker(work, limit)
        idle.put(number)
        return found

    for number in range(len(workers)):
        idle.put(number)
    with ThreadPoolExecutor(max(len(workers), 1)) as threads:
        waiting = {threads.submit(record, case): case for case in cases}
        try:
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            for worker in workers:
                worker.dismiss()


class Worker:
    """A process and a connection for one piece of work after the other; `work(parameters, begin)` must be importable.

    limit: processor time of one piece [s], counted from the moment when `work` calls `begin`. The operating system
    enforces the limit, also while the process executes compiled code.
    """

    def __init__(self, work: Work, limit: int) -> None:
        # spawned, not forked: compiled code with threads does not survive a fork
        context = get_context("spawn")
        self.line, other = context.Pipe()
        self.limit = limit
        self.process = context.Process(target=_serve, args=(other, work, limit), daemon=True)
        self.process.start()
        other.close()

    def ask(self, parameters: Any) -> Any:
        """Return the result of a piece of work; raise LostError when the process hangs or has died."""
        with suppress(BrokenPipeError, EOFError, ConnectionResetError):
            self.line.send(parameters)
            if self.line.poll(PATIENCE * self.limit):
                return self.line.recv()
            self.dismiss()
            raise LostError(f"did not answer within {PATIENCE * self.limit} s")
        self.process.join()
        code = self.process.exitcode or 0
        if ended_by(code) == "SIGXCPU":
            raise LostError(f"did not end within {self.limit} s of processor time", float(self.limit))
        raise LostError(f"its process died ({ended_by(code) or f'exit code {code}'})")

    def dismiss(self) -> None:
        """Terminate the process, also in the middle of its work."""
        # terminate first: the closed connection releases a thread that waits for an answer
        self.process.terminate()
        self.process.join()
        self.line.close()


def _serve(line: connection.Connection, work: Work, limit: int) -> None:
    """Do each piece of work that arrives, until the connection closes."""
    with suppress(EOFError, BrokenPipeError):  # the parent process has ended
        while True:
            parameters = line.recv()
            limit_seconds(None)
            line.send(work(parameters, lambda: limit_seconds(limit)))


def as_installed(folder: Path) -> dict[str, str]:
    """Return an environment for commands: results go to a folder, and bytecode is cached there, as when installed."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"FLEXCLEAR_RESULTS": str(folder / "results"), "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}


def installed(library: str) -> bool:
    """Return True when a library can be imported here."""
    try:
        return find_spec(library) is not None
    except ValueError:  # its import is blocked
        return False


def lacking() -> str:
    """Return the reason why child processes can be neither measured nor limited here; empty where they can."""
    return (
        ""
        if installed("resource")
        else "needs processor times and limits of child processes, which this system does not have"
    )


def _resource() -> Any:
    return import_module("resource")


def seconds_of_children() -> float:
    """Return the processor time of all child processes that have ended, descendants included [s]."""
    used = _resource().getrusage(_resource().RUSAGE_CHILDREN)
    return float(used.ru_utime + used.ru_stime)


def limit_seconds(seconds: int | None) -> None:
    """Limit the further processor time of this process [whole s]; None restores the highest permitted limit."""
    resource = _resource()
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    used = resource.getrusage(resource.RUSAGE_SELF)
    soft = hard if seconds is None else int(used.ru_utime + used.ru_stime) + seconds
    resource.setrlimit(resource.RLIMIT_CPU, (soft, hard))


def limit_files(size: int) -> Callable[[], None]:
    """Return a function that limits each file that a process writes to `size` bytes."""
    resource = _resource()
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def children(process: int) -> list[psutil.Process]:
    """Return the running child processes of a process; an empty list when the process has ended.

    Python's semaphore tracker is left out: killing it loses nothing, but Python then prints tracebacks when it exits.
    Children that still have their parent's command line are left out too: any of them may become the tracker.
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
    """Return the processor time that a process has used [s]; 0 when the process has ended."""
    try:
        times = process.cpu_times()
    except psutil.Error:
        return 0.0
    return float(times.user + times.system)


def ended_by(exit_code: int) -> str:
    """Return the name of the signal that ended a process, such as SIGSEGV; empty when no signal did.

    Real-time signals except the first and the last have no name and are returned with their number.
    """
    if exit_code >= 0:
        return ""
    try:
        return signal.Signals(-exit_code).name
    except ValueError:
        return f"signal {-exit_code}"
