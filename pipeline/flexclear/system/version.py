"""The version of the program, from its distribution."""

from __future__ import annotations

from functools import cache

DISTRIBUTION = "flexclear"


@cache
def version() -> str:
    """Return the version, such as ``0.1.0``; ``not installed`` where only the sources exist."""
    from importlib.metadata import PackageNotFoundError  # here, since it imports the e-mail package
    from importlib.metadata import version as installed

    try:
        return installed(DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"
