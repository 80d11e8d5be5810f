"""Workers are started once for a command, and end with it."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from flexclear.pipeline.core.workflow import cores, stopping, workers


def one(width: int = 1) -> tuple[int, int]:
    """Number of the process that does something for a crew of that width, and of the one that keeps its queue."""
    with workers.crew(width) as crew:
        return crew.pool.submit(os.getpid).result(), crew.server._process.pid


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def fail() -> None:
    with pytest.raises(KeyError), workers.crew(1):
        raise KeyError


def stop() -> None:
    with stopping.until(-1.0, "time is over"), workers.crew(1):
        assert stopping.requested()


def test_a_command_starts_its_workers_once() -> None:
    """Also where a later part of it wants as many as there are cores."""
    with workers.kept():
        first = one()
        assert one(cores.cores()) == first
        assert all(map(alive, first))
    assert not any(map(alive, first))


def test_outside_of_a_command_they_end_with_the_call() -> None:
    first = one()
    assert not any(map(alive, first))


@pytest.mark.parametrize("end", [fail, stop])
def test_workers_of_what_failed_or_was_stopped_are_not_kept(end: Callable[[], None]) -> None:
    with workers.kept():
        first = one()
        end()
        assert not alive(first[1])
        assert one() != first
