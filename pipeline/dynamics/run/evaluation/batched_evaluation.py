"""Engines that take their steps together in one thread, so that the rates of their attempts are evaluated at once.

Each engine's own thread asks for steps as ever (`run.trajectory`), and has them when its stepper has come back: paused,
at the end of a segment, or with an error. Meanwhile one of these threads lets up to `lanes` steppers proceed
(`compile.lanes`); the others wait, and one of them takes over when its own steps are done. What a stepper does depends
on nothing but its own engine, so neither the number of groups nor who else is in one changes a bit of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event, Lock

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import functions


@dataclass(eq=False)
class _Steps:
    """Steps that are asked for. words: of their lane.  turn: set when they are done, or their thread is to lead."""

    words: Sequence[int]
    turn: Event = field(default_factory=Event)
    done: bool = False


class LaneGroup:
    """Lanes for the steppers of one wiring.

    rows: closure rows that its code solves for.  address: of what lets steppers proceed.
    numbers: how many a mechanism of this wiring has in f at most.
    """

    def __init__(self, rows: bytes, address: int, numbers: int, width: int) -> None:
        self.rows = rows
        self._run = functions.function("lanes", address)
        self._table = np.zeros(m.LANES_HEAD + m.LANE_WORDS * width, np.int64)
        self._words = self._table[m.LANES_HEAD :].reshape(width, m.LANE_WORDS)
        self._places = np.zeros(7 * width, np.int64)
        room = np.zeros((numbers + 1) * width)
        self._numbers = room[-room.ctypes.data // 8 % width :]  # of all lanes one number, in no two lines of the cache
        self._waiting, self._busy = deque[_Steps](), dict[int, _Steps]()
        self._lock, self._led = Lock(), False

    def advance(self, function: int, arguments: Sequence[int]) -> None:
        """Let a stepper proceed until it comes back."""
        mine = _Steps((m.LANE_READY, function, *arguments))
        with self._lock:
            self._waiting.append(mine)
            self._table[m.LANES_CALLED_BACK] = 1  # calls back who leads, who looks at it between two evaluations
            if not self._led:
                self._led = True
                mine.turn.set()
        mine.turn.wait()
        if mine.done:
            return
        try:
            while not mine.done:
                self._proceed()
        finally:
            self._pass_on(mine)

    def _proceed(self) -> None:
        """Give free lanes to who waits, let all proceed until one comes back, and give its lane back."""
        with self._lock:
            self._table[m.LANES_CALLED_BACK] = 0
            self._places[6 * len(self._words) :] = 0  # where arrays lie others may have lain before
            for lane in np.flatnonzero(self._words[:, 0] == m.LANE_IDLE)[: len(self._waiting)]:
                self._words[lane] = self._waiting[0].words
                self._busy[lane] = self._waiting.popleft()
        self._run(*(array.ctypes.data for array in (self._table, self._places, self._numbers)))
        for lane in np.flatnonzero(self._words[:, 0] == m.LANE_DONE):
            self._free(int(lane))

    def _free(self, lane: int) -> None:
        self._words[lane, 0] = m.LANE_IDLE
        steps = self._busy.pop(lane)
        steps.done = True
        steps.turn.set()

    def _pass_on(self, mine: _Steps) -> None:
        """Let another thread lead, if there is one; also where this one has failed."""
        with self._lock:
            for lane in [lane for lane, steps in self._busy.items() if steps is mine]:
                self._free(lane)
            others = [*self._busy.values(), *(steps for steps in self._waiting if steps is not mine)]
            self._waiting = deque(steps for steps in self._waiting if steps is not mine)
            self._led = bool(others)
            if others:
                others[0].turn.set()


class Place:
    """Where up to `width` engines may step together, of them those that evaluate alike."""

    def __init__(self, width: int) -> None:
        self.width = width
        self._groups, self._making = dict[int, LaneGroup](), Lock()

    def group(self, rows: bytes, address: int, numbers: int) -> LaneGroup:
        """That which evaluates with this code."""
        with self._making:
            if address not in self._groups:
                self._groups[address] = LaneGroup(rows, address, numbers, self.width)
            return self._groups[address]


class Places:
    """So many places of one width, for as many engines at a time as they have lanes: `seats`."""

    def __init__(self, width: int, number: int) -> None:
        self.seats = width * number
        self._free = deque([Place(width) for _ in range(number)] * width)

    @contextmanager
    def place(self) -> Iterator[Place]:
        """One for an engine."""
        mine = self._free.popleft()
        try:
            yield mine
        finally:
            self._free.appendleft(mine)
