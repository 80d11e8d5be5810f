"""Processes that take cases in turn; one that takes too long or dies is replaced, and that is an outcome."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing import connection, get_context
from typing import Any

from benchmarks import system
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
    waiting = list(reversed(cases))
    crew: dict[connection.Connection, tuple[Worker, Case]] = {}
    try:
        while waiting or crew:
            while waiting and len(crew) < jobs:
                _next(crew, Worker(work, limit), waiting)
            for line in connection.wait(list(crew)):
                worker, case = crew[line]  # type: ignore[index]
                yield case, _outcome(worker)
                if worker.alive and waiting:
                    _next(crew, worker, waiting)
                else:
                    worker.dismiss()
                    del crew[worker.line]
    finally:
        for worker, _ in crew.values():
            worker.dismiss()


def _next(crew: dict[connection.Connection, tuple[Worker, Case]], worker: Worker, waiting: list[Case]) -> None:
    case = waiting.pop()
    worker.give(case.of)
    crew[worker.line] = worker, case


def _outcome(worker: Worker) -> Record:
    try:
        found: Record = worker.take()
    except LostError as lost:
        return {"verdict": WRONG, "reason": str(lost), "seconds": lost.seconds}
    return found


class Worker:
    """A process with a line to it, for one piece of work after the other; `work(parameters, begin)` must be importable.

    limit: processor time of a piece [s]. It begins when `work` calls `begin`, and is kept by the system: it also ends
    a process that sits in compiled code.
    """

    def __init__(self, work: Work, limit: int) -> None:
        # spawned, not forked: compiled code with threads does not survive a fork
        context = get_context("spawn")
        self.line, other = context.Pipe()
        self.limit, self.alive = limit, True
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
        self.alive = False
        self.process.join()
        code = self.process.exitcode or 0
        if system.ended_by(code) == "SIGXCPU":
            raise LostError(f"did not end within {self.limit} s of processor time", float(self.limit))
        raise LostError(f"its process died ({system.ended_by(code) or f'exit code {code}'})")

    def dismiss(self) -> None:
        """End the process, whatever it does."""
        self.alive = False
        self.line.close()
        self.process.terminate()
        self.process.join()


def _serve(line: connection.Connection, work: Work, limit: int) -> None:
    """Work through what comes until the line is cut."""
    with suppress(EOFError, BrokenPipeError):  # whoever asked is gone
        while True:
            parameters = line.recv()
            system.limit_seconds(None)
            line.send(work(parameters, lambda: system.limit_seconds(limit)))
