"""Code that only few runs need, for events that they meet: a result's key includes it only if its run met the event.

The code that always runs decides what is met, not the code for the event. So a result whose run met no such event stays
valid when that code is edited.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_noted: list[set[str]] = []
_noting = Lock()


def meet(what: str) -> None:
    """Note an event that a run has met; call it before code for that event is imported or compiled."""
    with _noting:
        for met in _noted:
            met.add(what)


@contextmanager
def noted() -> Iterator[set[str]]:
    """Yield the set of events that this process meets from here on; tasks that run concurrently share them."""
    met = set[str]()
    with _noting:
        _noted.append(met)
    try:
        yield met
    finally:
        with _noting:
            _noted[:] = [one for one in _noted if one is not met]
