"""What few runs meet, and which code they need only then: a result's key holds that code if its run has met it.

Which code is run decides what is met, not the code that is for it, so a result whose run has met nothing of the kind
stays valid when that code is edited.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_noted: list[set[str]] = []
_noting = Lock()


def meet(what: str) -> None:
    """To be said before code is imported or compiled for something that a run has met."""
    with _noting:
        for met in _noted:
            met.add(what)


@contextmanager
def noted() -> Iterator[set[str]]:
    """What this process meets from here on; more than that of one task where several run in it."""
    met = set[str]()
    with _noting:
        _noted.append(met)
    try:
        yield met
    finally:
        with _noting:
            _noted[:] = [one for one in _noted if one is not met]
