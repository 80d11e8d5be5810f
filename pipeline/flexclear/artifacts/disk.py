"""Atomically written files with their own digests, copies for display, locks, and the removal of leftovers.

Temporary files and locks of a process that died stay on disk, whatever ended it; `sweep` recognises temporary files by
their age, and locks by nobody holding them.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.system import platforms
from flexclear.system.errors import ResourceError

if TYPE_CHECKING:
    from filelock import FileLock

#: error numbers of a full or limited disk
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
#: ages at which temporary files and unfinished work are removed: no file takes so long to write [s]
ABANDONED = {".tmp": 3600.0, ".part": 7 * 86400.0}


def sha256(content: bytes) -> str:
    """Return the hexadecimal SHA-256 digest of bytes."""
    return hashlib.sha256(content).hexdigest()


def digest_of(path: Path) -> str:
    """Return the SHA-256 digest of a file of any size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def publish(path: Path, content: bytes) -> str:
    """Write a file so that it exists in full or not at all; return its SHA-256 digest."""
    with temporary(path) as scratch:
        scratch.write_bytes(content)
        platforms.replace(scratch, path)
    return sha256(content)


def checked(table: Mapping[str, Any]) -> bytes:
    """Encode a table as a file that carries its own digest: ``{"content": ..., "sha256": ...}``."""
    whole = {"content": table, "sha256": _digest(table)}
    return json.dumps(whole, indent=1, sort_keys=True, ensure_ascii=False).encode() + b"\n"


def read_checked(path: Path) -> dict[str, Any] | None:
    """Return the table in a file of `checked`; None when there is no such file or a bit of it has changed."""
    try:
        whole = json.loads(path.read_bytes())
        table = whole["content"]
        return dict(table) if whole["sha256"] == _digest(table) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _digest(table: Mapping[str, Any]) -> str:
    return sha256(json.dumps(table, sort_keys=True, ensure_ascii=False).encode())


def copy(source: Path, target: Path) -> None:
    """Make `target` a read-only copy with the time of `source`."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with temporary(target) as scratch:
        shutil.copy2(source, scratch)
        scratch.chmod(0o444)
        platforms.replace(scratch, target)


def is_copy(source: Path, target: Path) -> bool:
    """Return True when `target` is as `copy` left it: of equal size and time."""
    try:
        old, new = source.stat(), target.stat()
    except OSError:
        return False
    return (old.st_size, old.st_mtime_ns) == (new.st_size, new.st_mtime_ns)


@contextlib.contextmanager
def temporary(path: Path) -> Iterator[Path]:
    """Yield a name next to `path` that no other process uses; remove the file at the end, also after an error."""
    scratch = path.with_name(f".{path.name.lstrip('.').partition('.')[0]}.{os.urandom(8).hex()}.tmp")
    try:
        yield scratch
    finally:
        scratch.unlink(missing_ok=True)


@contextlib.contextmanager
def disk_limits(folder: Path) -> Iterator[None]:
    """Convert OSError of writing to ResourceError, with the limit of the machine in words."""
    try:
        yield
    except OSError as error:
        why = "the disk is full or a file size limit was reached" if error.errno in FULL else str(error.strerror)
        raise ResourceError(f"cannot write below {folder}: {why}; no partial file remains") from None


@contextlib.contextmanager
def locked(path: Path, *, wait: bool = True, waiting: Callable[[], None] = lambda: None) -> Iterator[bool]:
    """Yield True when this process holds the lock file, and remove it after; call `waiting` before any wait.

    The operating system drops the lock of a process that dies, whatever ended it.
    """
    from filelock import FileLock  # here, since a command whose results are all up to date locks nothing

    lock = FileLock(path, thread_local=False)
    held = _acquire(lock, wait=False)
    if not held and wait:
        waiting()
        held = _acquire(lock, wait=True)
    try:
        yield held
    finally:
        if held:
            with contextlib.suppress(OSError):  # Windows removes no open file
                path.unlink(missing_ok=True)  # while held: waiting processes then look for the file again
        lock.release()


def _acquire(lock: FileLock, *, wait: bool) -> bool:
    """Acquire the lock and return True; return False when another process holds it."""
    from filelock import Timeout

    try:
        lock.acquire(blocking=wait)
    except Timeout:
        return False
    return True


def sweep(root: Path) -> int:
    """Remove temporary files and locks of ended processes below `root`, and unfinished work that nobody has continued
    for long; return the number of removed files."""
    removed = 0
    for folder, _, names in os.walk(root):
        for path in (Path(folder, name) for name in names if name.endswith((*ABANDONED, ".lock"))):
            with contextlib.suppress(OSError):  # the folder is read-only, or another process removes the file
                if path.suffix == ".lock":
                    with locked(path, wait=False) as held:
                        removed += held  # its release removes it
                elif time.time() - path.stat().st_mtime > ABANDONED[path.suffix]:
                    path.unlink()
                    removed += 1
    return removed
