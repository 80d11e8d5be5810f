"""Engines that take their steps side by side in one thread, so that their evaluations are made at once.

Each engine's own thread asks for steps as ever (`run.trajectory`), and is notified when its stepper has come back:
paused, at the end of a segment, or with an error. Meanwhile the group's thread lets up to `lanes` steppers run, each on
a stack of its own (`compile.stacks`), and evaluates for all of them together (`compile.lanes`). What a stepper does
depends on nothing but its own engine, so neither the number of groups nor who else is in one changes a bit of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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


@dataclass(frozen=True)
class Code:
    """Right-hand sides of one wiring with equal bits (`functions.specialised`).

    abreast: address of what lets steppers run.  alone: that of the evaluation of one state; 0 where there is none.
    numbers: how many a mechanism of this wiring has in f at most.
    """

    abreast: int
    alone: int
    numbers: int


class LaneGroup:
    """A thread that lets steppers run while it is open.

    rows: closure rows that its code solves for.
    """

    def __init__(self, rows: bytes, code: Code, lanes: int) -> None:
        self.rows, self.lanes = rows, lanes
        self.wait = stacks.addresses()["wait"]
        self._run = functions.LANES(code.abreast)
        self._stacks = stacks.Stacks(lanes)
        self._table = np.zeros(stacks.HEAD + lanes, np.int64)
        self._table[stacks.ALONE] = code.alone
        self._places = np.zeros(7 * lanes, np.int64)
        room = np.zeros((code.numbers + 1) * lanes)
        self._numbers = room[-room.ctypes.data // 8 % lanes :]  # of all lanes one number, in no two lines of the cache
        self._table[stacks.HEAD :] = [record.ctypes.data for record in self._stacks.records]
        self._waiting, self._news, self._closed = deque[_Steps](), Condition(), False
        self._failed: BaseException | None = None
        self._thread = Thread(target=self._work, name="steps side by side", daemon=True)
        self._thread.start()

    def advance(self, function: int, arguments: Sequence[int]) -> None:
        """Let a stepper run until it comes back; raises what ended the group's thread, if something did."""
        steps = _Steps(function, arguments)
        with self._news:
            if self._failed is not None:
                raise self._failed
            self._waiting.append(steps)
            self._table[stacks.WANTED] = 1  # calls the compiled code back, which looks at it between two evaluations
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
        except BaseException as error:  # for instance no memory: whoever waits is notified, instead of waiting for ever
            with self._news:
                self._failed = error
                for steps in [*self._waiting, *filter(None, busy)]:
                    steps.back.set()

    def _let_run(self, busy: list[_Steps | None]) -> None:
        """What the thread does: let steppers run as long as the group is open."""
        states = self._stacks.records[:, stacks.STATE]
        while self._take(busy):
            arrays = (self._table, self._places, self._numbers)
            self._run(*(array.ctypes.data for array in arrays), stacks.addresses()["resume"])
            for lane in np.flatnonzero(states == stacks.DONE):
                states[lane] = stacks.IDLE
                steps, busy[lane] = busy[lane], None
                if steps is not None:
                    steps.back.set()

    def _take(self, busy: list[_Steps | None]) -> bool:
        """Give the steps that are awaited to free lanes, waiting for some where all are free; False: no more."""
        with self._news:
            while not self._waiting and not any(busy):
                if self._closed:
                    return False
                self._news.wait()
            self._table[stacks.WANTED] = 0
            self._places[6 * self.lanes :] = 0  # where arrays lie others may have lain before
            while self._waiting and None in busy:
                lane, steps = busy.index(None), self._waiting.popleft()
                busy[lane] = steps
                self._stacks.begin(lane, steps.function, steps.arguments)
        return True


class LaneGroups:
    """LaneGroups for the engines of so many threads, each made when an engine first needs it; of one width."""

    def __init__(self, lanes: int, threads: int) -> None:
        self.width, self.lanes = lanes, lanes * threads
        self._aboard, self._groups = [0] * threads, dict[tuple[int, int], LaneGroup]()
        self._boarding = Lock()

    @contextmanager
    def place(self) -> Iterator[Place]:
        """In the thread with the fewest engines; meanwhile it has one more."""
        with self._boarding:
            thread = self._aboard.index(min(self._aboard))
            self._aboard[thread] += 1
        try:
            yield Place(self, thread)
        finally:
            with self._boarding:
                self._aboard[thread] -= 1

    def group(self, thread: int, rows: bytes, code: Code) -> LaneGroup:
        """That of a thread which evaluates with this code."""
        with self._boarding:
            made = self._groups.get((thread, code.abreast))
            if made is None:
                made = self._groups[thread, code.abreast] = LaneGroup(rows, code, self.width)
            return made

    def close(self) -> None:
        """End all threads."""
        for group in self._groups.values():
            group.close()


@dataclass(frozen=True)
class Place:
    """Where an engine may step together with others: of those in a thread the group that evaluates as it does."""

    groups: LaneGroups
    thread: int


@contextmanager
def groups(lanes: int, threads: int) -> Iterator[LaneGroups]:
    """LaneGroups, while they are used."""
    made = LaneGroups(lanes, threads)
    try:
        yield made
    finally:
        made.close()
