"""Which files a task reads: what they hold decides its result, so it is among the facts of its key.

Whoever reads a file notes it (`note`): readers of scenes, recipes and tables, `core.system.external_files` for what
others made, with the companions of its format, and what assembles pages.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from flexclear.pipeline.core.system.errors import ResourceError

#: what is in the facts for a file that is not there, and for what is no file
ABSENT, SPECIAL = "absent", "no file"
#: absolute path -> digest of what was there when it was first noted; None where no task runs
_current: dict[str, str] | None = None


def note(path: Path) -> None:
    """Record that the task that runs, if any, is about to read this file."""
    if _current is not None:
        name = os.path.abspath(path)
        if name not in _current:
            _current[name] = digest(name)


@contextmanager
def watched(base: Path) -> Iterator[dict[str, str]]:
    """Yield a table that is filled at the end: path relative to `base` -> digest, of every file noted meanwhile.

    Raises ResourceError when a file changed meanwhile.
    """
    global _current
    watched_files: dict[str, str] = {}
    seen: dict[str, str] = {}
    before, _current = _current, seen
    try:
        yield watched_files
    finally:
        _current = before
    for name, then in seen.items():
        if digest(name) != then:
            raise ResourceError(f"{name} changed while it was read; run again")
        watched_files[_relative(name, base)] = then


def _relative(name: str, base: Path) -> str:
    """A file relative to a folder; on another drive there is no way from there."""
    try:
        return os.path.relpath(name, base)
    except ValueError:
        return name


def digests(names: Iterable[str], base: Path) -> dict[str, str]:
    """Content of the files in these folders, as `watched` gives it."""
    return {name: digest(os.path.normpath(base / name)) for name in names}


def digest(path: str) -> str:
    """The sha256 of a file; what is no file, or is not there, has a word instead."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            return SPECIAL
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ABSENT


def facts(file_digests: Mapping[str, str]) -> dict[str, str]:
    """As facts of a key."""
    return {f"file {name}": value for name, value in sorted(file_digests.items())}
