"""Engines that step together in one thread, so that one call evaluates the rates of all their attempts.

Each engine's own thread requests steps as usual (`run.trajectory`), and waits until its stepper returns: paused, at the
end of a segment, or with an error. One of these threads leads: it advances up to `lanes` steppers (`compile.lanes`)
while the others wait; when its own steps are done, another thread leads. A stepper depends on its own engine alone, so
neither the number of groups nor their members change a bit of its result.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event, Lock

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions


@dataclass(eq=False)
class _Steps:
    """Requested steps. words: of their lane.  turn: event that is set when they are done, or their thread must lead."""

    words: Sequence[int]
    turn: Event = field(default_factory=Event)
    done: bool = False


class LaneGroup:
    """Lanes for the steppers of one topology.

    rows: closure rows that the code solves for.  address: of the function that advances steppers.
    numbers: largest length of f for a mechanism of this topology.
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
        """Advance a stepper until it returns."""
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
        """Assign free lanes to waiting steppers, advance all until one returns, and free its lane."""
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
        """Let another waiting thread lead, also when this one has failed."""
        with self._lock:
            for lane in [lane for lane, steps in self._busy.items() if steps is mine]:
                self._free(lane)
            others = [*self._busy.values(), *(steps for steps in self._waiting if steps is not mine)]
            self._waiting = deque(steps for steps in self._waiting if steps is not mine)
            self._led = bool(others)
            if others:
                others[0].turn.set()


class Place:
    """Groups of up to `width` engines that step together when they evaluate with the same code."""

    def __init__(self, width: int) -> None:
        self.width = width
        self._groups, self._making = dict[int, LaneGroup](), Lock()

    def group(self, rows: bytes, address: int, numbers: int) -> LaneGroup:
        """Return the group that evaluates with this code."""
        with self._making:
            if address not in self._groups:
                self._groups[address] = LaneGroup(rows, address, numbers, self.width)
            return self._groups[address]


class Places:
    """Several places of one width; `seats` engines can use them at a time."""

    def __init__(self, width: int, number: int) -> None:
        self.seats = width * number
        self._free = deque([Place(width) for _ in range(number)] * width)

    @contextmanager
    def place(self) -> Iterator[Place]:
        """Return the next place for an engine."""
        mine = self._free.popleft()
        try:
            yield mine
        finally:
            self._free.appendleft(mine)
