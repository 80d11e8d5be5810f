"""Engines that take their steps side by side in one thread, so that their evaluations are made at once.

Each engine's own thread asks for steps as ever (`run.trajectory`), and is told when its stepper has come back: paused,
at the end of a segment, or with an error. Meanwhile the crew's thread lets up to `lanes` steppers run, each on a stack
of its own (`compile.stacks`), and evaluates for all of them together (`compile.lanes`). What a stepper does depends on
nothing but its own engine, so neither the number of crews nor who else is in one changes a bit of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from threading import Condition, Event, Lock, Thread

import numpy as np

from flexclear.pipeline.dynamics.compile import functions, stacks


@dataclass
class _Steps:
    """Steps that are asked for: a function by its address and those of its arguments. back: set when it came back."""

    function: int
    arguments: Sequence[int]
    back: Event = field(default_factory=Event)


class Crew:
    """A thread that lets steppers run while it is open.

    kept: closure rows that its code solves for.  code: address of that (`functions.specialised`).
    """

    def __init__(self, kept: bytes, code: int, lanes: int) -> None:
        self.kept, self.lanes, self.aboard = kept, lanes, 0
        self.wait = stacks.addresses()["wait"]
        self._run = functions.LANES(code)
        self._stacks = stacks.Stacks(lanes)
        self._table = np.zeros(stacks.HEAD + lanes, np.int64)
        self._places = np.zeros(6 * lanes, np.int64)
        self._table[stacks.HEAD :] = [record.ctypes.data for record in self._stacks.records]
        self._waiting, self._news, self._closed = deque[_Steps](), Condition(), False
        self._failed: BaseException | None = None
        self._thread = Thread(target=self._work, name="steps side by side", daemon=True)
        self._thread.start()

    def advance(self, function: int, arguments: Sequence[int]) -> None:
        """Let a stepper run until it comes back; raises what ended the crew's thread, if something did."""
        steps = _Steps(function, arguments)
        with self._news:
            if self._failed is not None:
                raise self._failed
            self._waiting.append(steps)
            self._table[0] = 1  # calls the compiled code back, which looks at it between two evaluations
            self._news.notify()
        steps.back.wait()
        if self._failed is not None:
            raise self._failed

    def close(self) -> None:
        """End the thread; nobody asks for steps any more."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._thread.join()

    def _work(self) -> None:
        busy: list[_Steps | None] = [None] * self.lanes
        try:
            self._let_run(busy)
        except BaseException as error:  # for instance no memory: whoever waits is told, instead of waiting for ever
            with self._news:
                self._failed = error
                for steps in [*self._waiting, *filter(None, busy)]:
                    steps.back.set()

    def _let_run(self, busy: list[_Steps | None]) -> None:
        """What the thread does: let steppers run as long as the crew is open."""
        states = self._stacks.records[:, stacks.STATE]
        while self._take(busy):
            self._run(self._table.ctypes.data, self._places.ctypes.data, stacks.addresses()["resume"])
            for lane in np.flatnonzero(states == stacks.DONE):
                states[lane] = stacks.IDLE
                steps, busy[lane] = busy[lane], None
                if steps is not None:
                    steps.back.set()

    def _take(self, busy: list[_Steps | None]) -> bool:
        """Give the steps that are waited for to free lanes, waiting for some where all are free; False: no more."""
        with self._news:
            while not self._waiting and not any(busy):
                if self._closed:
                    return False
                self._news.wait()
            self._table[0] = 0
            while self._waiting and None in busy:
                lane, steps = busy.index(None), self._waiting.popleft()
                busy[lane] = steps
                self._stacks.begin(lane, steps.function, steps.arguments)
        return True


class Crews:
    """Some crews for engines of one model."""

    def __init__(self, crews: list[Crew]) -> None:
        self._crews, self._boarding = crews, Lock()
        self.lanes = sum(crew.lanes for crew in crews)

    @contextmanager
    def place(self) -> Iterator[Crew]:
        """The crew with the fewest engines; meanwhile it has one more."""
        with self._boarding:
            crew = min(self._crews, key=lambda one: one.aboard)
            crew.aboard += 1
        try:
            yield crew
        finally:
            with self._boarding:
                crew.aboard -= 1


@contextmanager
def crews(kept: bytes, code: int, lanes: int, number: int) -> Iterator[Crews]:
    """So many crews, while they are used."""
    with ExitStack() as stack:
        made = []
        for _ in range(number):
            made.append(Crew(kept, code, lanes))
            stack.callback(made[-1].close)
        yield Crews(made)
