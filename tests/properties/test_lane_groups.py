"""Who leads the steppers of a lane group: one thread at a time, whatever becomes of it."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.run.evaluation.batched_evaluation import LaneGroup, Places

ARGUMENTS = 12


def group(width: int, run: Callable[[np.ndarray], None]) -> LaneGroup:
    """A group whose compiled function is replaced by what gets all words, shape (width, LANE_WORDS)."""
    made = LaneGroup(b"", 0, 1, width)
    made._run = lambda *_: run(made._words)
    return made


def finish(words: np.ndarray, number: int) -> None:
    """Let the first of the steppers that may proceed come to their end."""
    words[np.flatnonzero(words[:, 0] == m.LANE_READY)[:number], 0] = m.LANE_DONE


def asked(made: LaneGroup, count: int) -> list[BaseException | None]:
    """What so many threads that ask for steps at the same time get: nothing, or an error."""
    together = threading.Barrier(count)

    def ask(k: int) -> None:
        together.wait()
        made.advance(100 + k, [k] * ARGUMENTS)

    with ThreadPoolExecutor(count) as pool:
        return [future.exception(timeout=60) for future in [pool.submit(ask, k) for k in range(count)]]


def test_more_steppers_than_lanes_all_come_to_their_end() -> None:
    """One comes back at a time, which need not be that of the thread that leads; each has its own words."""
    seen = set[tuple[int, ...]]()

    def run(words: np.ndarray) -> None:
        seen.update(tuple(row) for row in words[words[:, 0] == m.LANE_READY].tolist())
        finish(words, 1)

    made = group(2, run)
    assert asked(made, 7) == [None] * 7
    assert seen == {(m.LANE_READY, 100 + k, *[k] * ARGUMENTS) for k in range(7)}
    assert (made._words[:, 0] == m.LANE_IDLE).all()
    assert asked(made, 3) == [None] * 3  # whoever comes later leads again


def test_where_the_thread_that_leads_fails_another_one_leads() -> None:
    """Its error ends its own steps only."""
    rounds = list[int]()

    def run(words: np.ndarray) -> None:
        rounds.append(1)
        if len(rounds) == 1:
            raise MemoryError("the first")
        finish(words, 8)

    made = group(4, run)
    errors = [error for error in asked(made, 5) if error is not None]
    assert [str(error) for error in errors] == ["the first"]
    assert (made._words[:, 0] == m.LANE_IDLE).all()
    assert asked(made, 2) == [None, None]


def test_who_leads_is_called_back_for_a_stepper_that_comes_later() -> None:
    """`memory.LANES_CALLED_BACK` says so to the compiled function, which looks at it between two evaluations."""
    begun, called = threading.Event(), list[int]()

    def run(words: np.ndarray) -> None:
        begun.set()
        if len(called) == 0:
            until = time.monotonic() + 60.0
            while not made._table[m.LANES_CALLED_BACK] and time.monotonic() < until:
                pass
        called.append(int((words[:, 0] == m.LANE_READY).sum()))
        if len(called) > 1:
            finish(words, 2)

    made = group(2, run)
    first = threading.Thread(target=made.advance, args=(1, [0] * ARGUMENTS))
    first.start()
    assert begun.wait(60)
    made.advance(2, [0] * ARGUMENTS)
    first.join(60)
    assert called == [1, 2]


def test_places_are_taken_in_turn_and_as_often_as_they_have_lanes() -> None:
    places = Places(2, 3)
    assert places.seats == 6
    held = [places.place() for _ in range(6)]
    taken = [one.__enter__() for one in held]
    assert len(set(taken[:3])) == 3
    assert taken[3:] == taken[:3]
    held[4].__exit__(None, None, None)
    with places.place() as again:
        assert again is taken[4]
    assert again.group(b"a", 0, 1) is again.group(b"b", 0, 1)
    assert again.group(b"a", 0, 1) is not taken[0].group(b"a", 0, 1)
