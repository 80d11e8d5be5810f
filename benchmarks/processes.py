"""Processes that take work in turn; one that takes too long or dies is replaced, and that is an outcome."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from multiprocessing import connection, get_context
from queue import SimpleQueue
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
        if system.ended_by(code) == "SIGXCPU":
            raise LostError(f"did not end within {self.limit} s of processor time", float(self.limit))
        raise LostError(f"its process died ({system.ended_by(code) or f'exit code {code}'})")

    def dismiss(self) -> None:
        """End the process, whatever it does."""
        # first of all: a thread that waits for an answer is told by the end of its line
        self.process.terminate()
        self.process.join()
        self.line.close()


def _serve(line: connection.Connection, work: Work, limit: int) -> None:
    """Work through what comes until the line is cut."""
    with suppress(EOFError, BrokenPipeError):  # whoever asked is gone
        while True:
            parameters = line.recv()
            system.limit_seconds(None)
            line.send(work(parameters, lambda: system.limit_seconds(limit)))
