"""How work reports its progress."""

from __future__ import annotations

from collections.abc import Callable

#: receives the finished fraction of the work (None: unknown) and what is being done
Progress = Callable[[float | None, str], None]


def silent(fraction: float | None, text: str) -> None:
    """A progress callback that says nothing."""
