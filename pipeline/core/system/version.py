"""The version of the program, as its distribution says it."""

from __future__ import annotations

from functools import cache

DISTRIBUTION = "flexclear"


@cache
def version() -> str:
    """Such as ``0.1.0``; ``not installed`` where only the sources are there."""
    from importlib.metadata import PackageNotFoundError  # here, since it brings readers of e-mail
    from importlib.metadata import version as installed

    try:
        return installed(DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"
