"""Processes that take cases in turn; one that takes too long or dies is replaced, and that is an outcome."""

from __future__ import annotations

import resource
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing import connection, get_context
from typing import Any

from benchmarks.family import WRONG, Case, Record

Work = Callable[[Any, Callable[[], None]], Record]


def outcomes(cases: Sequence[Case], jobs: int, work: Work, limit: int) -> Iterator[tuple[Case, Record]]:
    """Every case with its record, as they come; `work(case.of, compiled)` must be importable.

    limit: processor time of a case [s]. It begins when `work` calls `compiled`, and is kept by the system: it also ends
    a process that sits in compiled code.
    """
    waiting = list(reversed(cases))
    crew: dict[connection.Connection, _Worker] = {}
    try:
        while waiting or crew:
            while waiting and len(crew) < jobs:
                worker = _Worker(work, limit)
                crew[worker.line] = worker
                worker.give(waiting.pop())
            for line in connection.wait(list(crew)):
                worker = crew[line]  # type: ignore[index]
                case, found = worker.case, worker.take()
                yield case, found
                if worker.alive and waiting:
                    worker.give(waiting.pop())
                else:
                    worker.dismiss()
                    del crew[worker.line]
    finally:
        for worker in crew.values():
            worker.dismiss()


class _Worker:
    """A process with a line to it, and the case that it has in hand."""

    def __init__(self, work: Work, limit: int) -> None:
        # spawned, not forked: compiled code with threads does not survive a fork
        context = get_context("spawn")
        self.line, other = context.Pipe()
        self.limit, self.alive = limit, True
        self.case: Case
        self.process = context.Process(target=_serve, args=(other, work, limit), daemon=True)
        self.process.start()
        other.close()

    def give(self, case: Case) -> None:
        self.case = case
        self.line.send(case.of)

    def take(self) -> Record:
        """The record of the case in hand; that a process died is one, too."""
        with suppress(EOFError, ConnectionResetError):
            found: Record = self.line.recv()
            return found
        self.alive = False
        self.process.join()
        if self.process.exitcode == -signal.SIGXCPU:
            reason = f"did not end within {self.limit} s of processor time"
            return {"verdict": WRONG, "reason": reason, "seconds": float(self.limit)}
        return {"verdict": WRONG, "reason": f"its process died (exit code {self.process.exitcode})", "seconds": 0.0}

    def dismiss(self) -> None:
        self.line.close()
        self.process.terminate()
        self.process.join()


def _serve(line: connection.Connection, work: Work, limit: int) -> None:
    """Work through what comes until the line is cut."""
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]

    def begin() -> None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + limit, hard))

    with suppress(EOFError, BrokenPipeError):  # whoever asked is gone
        while True:
            parameters = line.recv()
            resource.setrlimit(resource.RLIMIT_CPU, (hard, hard))
            line.send(work(parameters, begin))
