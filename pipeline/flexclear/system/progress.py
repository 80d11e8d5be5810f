"""The callback by which work reports its progress."""

from __future__ import annotations

from collections.abc import Callable

#: receives the finished fraction of the work (None: unknown) and a text on the current activity
Progress = Callable[[float | None, str], None]


def silent(fraction: float | None, text: str) -> None:
    """Ignore reports of progress."""
