"""Processes that take work in turn; one that takes too long or dies is replaced, and that is an outcome.

Windows has no module `resource`. What needs it to measure or limit child processes refuses there in words (`lacking`).
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

from benchmarks import processes
from benchmarks.family import WRONG, Case, Record

Work = Callable[[Any, Callable[[], None]], Any]
#: an answer is waited for so many times the limit of processor time: what sleeps for ever takes none
PATIENCE = 10


class LostError(Exception):
    """A process gave no answer. seconds: processor time of its case [s], as far as that is known."""

    def __init__(self, reason: str, seconds: float = 0.0) -> None:
        super().__init__(reason)
        self.seconds = seconds


def outcomes(cases: Sequence[Case], jobs: int, work: Work, limit: int) -> Iterator[tuple[Case, Record]]:
    """Every case with its record, as they come; see `Worker`, which is given what the case is of."""
    workers = [Worker(work, limit) for _ in range(min(jobs, len(cases)))]
    idle: SimpleQueue[int] = SimpleQueue()

    def record(case: Case) -> Record:
        number = idle.get()
        try:
            workers[number].give(case.of)
            found: Record = workers[number].take()
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
    """A process with a line to it, for one piece of work after the other; `work(parameters, begin)` must be importable.

    limit: processor time of a piece [s]. It begins when `work` calls `begin`, and is kept by the system: it also ends
    a process that sits in compiled code.
    """

    def __init__(self, work: Work, limit: int) -> None:
        # spawned, not forked: compiled code with threads does not survive a fork
        context = get_context("spawn")
        self.line, other = context.Pipe()
        self.limit = limit
        self.process = context.Process(target=_serve, args=(other, work, limit), daemon=True)
        self.process.start()
        other.close()

    def give(self, parameters: Any) -> None:
        """Begin a piece of work; `take` raises when the process is gone."""
        with suppress(BrokenPipeError):
            self.line.send(parameters)

    def take(self) -> Any:
        """What became of it, waited for; LostError when the process hangs, or has died."""
        with suppress(EOFError, ConnectionResetError):
            if self.line.poll(PATIENCE * self.limit):
                return self.line.recv()
            self.dismiss()
            raise LostError(f"did not answer within {PATIENCE * self.limit} s")
        self.process.join()
        code = self.process.exitcode or 0
        if processes.ended_by(code) == "SIGXCPU":
            raise LostError(f"did not end within {self.limit} s of processor time", float(self.limit))
        raise LostError(f"its process died ({processes.ended_by(code) or f'exit code {code}'})")

    def dismiss(self) -> None:
        """End the process, whatever it does."""
        # first of all: the end of its line ends a thread that waits for an answer
        self.process.terminate()
        self.process.join()
        self.line.close()


def _serve(line: connection.Connection, work: Work, limit: int) -> None:
    """Work through what comes until the line is cut."""
    with suppress(EOFError, BrokenPipeError):  # whoever asked is gone
        while True:
            parameters = line.recv()
            processes.limit_seconds(None)
            line.send(work(parameters, lambda: processes.limit_seconds(limit)))


def as_installed(folder: Path) -> dict[str, str]:
    """Environment of commands whose results go to a folder, and which keep Python's bytecode, as if installed."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"FLEXCLEAR_RESULTS": str(folder / "results"), "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}


def installed(library: str) -> bool:
    """Whether a library can be imported here."""
    try:
        return find_spec(library) is not None
    except ValueError:  # its import is blocked
        return False


def lacking() -> str:
    """Why child processes can be neither measured nor limited here; empty where they can."""
    return (
        ""
        if installed("resource")
        else "needs processor times and limits of child processes, which this system does not have"
    )


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
