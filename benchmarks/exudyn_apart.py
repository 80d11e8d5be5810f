"""Exudyn in a process of its own: what crashes, hangs or takes too long there is an outcome of that setting."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from benchmarks.crew import LostError, Worker
from benchmarks.exudyn_model import Outcome, solve
from benchmarks.mechanisms import Mechanism

#: processor time after which a run counts as one that hangs [s]; the dearest takes a fifth of it
LIMIT = 120


class Peer:
    """Exudyn's runs of one mechanism, timed inside their process around the integration alone.

    A process serves one run after the other, so that no time holds its start, and all but its first run are warm.
    After a run that failed the next one is given a fresh process.
    """

    def __init__(self, here: Mechanism, body: str) -> None:
        self.here, self.body = here, body
        self.worker: Worker | None = None

    def run(self, method: str, step: float, sampling: float) -> Outcome:
        """A run at a fixed step, sampled every so many seconds; arguments of `exudyn_model.solve`."""
        used = self.worker is not None
        try:
            found = self._asked((self.here, self.body, method, step, sampling))
        except LostError as lost:
            self.close()
            if used and not lost.seconds:  # what earlier runs left may have killed it
                return self.run(method, step, sampling)
            return Outcome(0.0, None, str(lost))
        if found.samples is None:
            self.close()
        return found

    def _asked(self, parameters: tuple[Any, ...]) -> Outcome:
        self.worker = self.worker or Worker(work, LIMIT)
        self.worker.give(parameters)
        found: Outcome = self.worker.take()
        return found

    def close(self) -> None:
        """End its process."""
        if self.worker is not None:
            self.worker.dismiss()
        self.worker = None


def work(parameters: tuple[Any, ...], begin: Callable[[], None]) -> Outcome:
    """What its process does."""
    begin()
    return solve(*parameters)
