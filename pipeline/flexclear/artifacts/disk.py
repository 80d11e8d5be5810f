"""Atomically written files with their own digests, copies for display, locks, and the removal of leftovers.

Temporary files and locks of a process that died stay on disk, whatever ended it; `remove_leftovers` recognises
temporary files by the name of their owner, and locks by nobody holding them.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import platform
import re
import shutil
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.system import platforms
from flexclear.system.errors import ResourceError

if TYPE_CHECKING:
    from filelock import FileLock

#: bytes that no table of records, facts or imports exceeds
LARGEST_TABLE = 64 << 20
#: bytes copied at once: a larger buffer is newly allocated each time, which takes longer than copying
PIECE = 1 << 17
#: error numbers of a full or limited disk
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
#: error numbers of a file system without locks
LOCKLESS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
_TEMPORARY = re.compile(r"\.(?P<stem>[^.]*)\.(?P<host>[0-9a-f]{8})-(?P<pid>\d+)\.[0-9a-f]{8}\.tmp")


def sha256(content: bytes) -> str:
    """Return the hexadecimal SHA-256 digest of bytes."""
    return hashlib.sha256(content).hexdigest()


def require_ordinary(path: Path) -> int:
    """Return a file's size [bytes]; raise OSError for a folder, a device (possibly endless) or a pipe (may wait)."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is not an ordinary file", str(path))
    return status.st_size


def read_whole(path: Path, largest: int | None = None) -> bytes:
    """Read an ordinary file; raise OSError for other files, and for more bytes than `largest`."""
    size = require_ordinary(path)
    if largest is not None and size > largest:
        raise OSError(errno.EFBIG, f"it is larger than {largest} bytes", str(path))
    return path.read_bytes()


def digest_of(path: Path) -> str:
    """Return the SHA-256 digest of an ordinary file of any size; raise OSError for other files."""
    require_ordinary(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def publish(path: Path, content: bytes) -> str:
    """Write a file so that it exists in full or not at all; return its SHA-256 digest."""
    with temporary_name(path) as scratch:
        scratch.write_bytes(content)
        if scratch.read_bytes() != content:
            raise OSError(errno.EIO, "the written content cannot be read back", str(path))
        digest = commit_file(scratch, path)
    platforms.sync_folder(path.parent)
    return digest


def commit_file(scratch: Path, path: Path) -> str:
    """Force a file's bytes to the disk and rename the file to `path`; return its SHA-256 digest.

    The new name is on the disk only after `platforms.sync_folder`, which covers all names of the folder.
    """
    with scratch.open("rb+") as file:  # Windows syncs only files that are open for writing
        os.fsync(file.fileno())
    digest = digest_of(scratch)
    platforms.replace(scratch, path)
    return digest


def encode_with_digest(table: Mapping[str, Any]) -> bytes:
    """Encode a table as a file that carries its own digest: ``{"content": ..., "sha256": ...}``."""
    whole = {"content": table, "sha256": _digest(table)}
    return json.dumps(whole, indent=1, sort_keys=True, ensure_ascii=False).encode() + b"\n"


def read_checked(path: Path) -> dict[str, Any] | None:
    """Return the table in a file of `encode_with_digest`; None without such a file, or where a bit has changed."""
    try:
        whole = json.loads(read_whole(path, LARGEST_TABLE))
        table = whole["content"]
        return dict(table) if whole["sha256"] == _digest(table) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _digest(table: Mapping[str, Any]) -> str:
    return sha256(json.dumps(table, sort_keys=True, ensure_ascii=False).encode())


def copy(source: Path, target: Path) -> None:
    """Make `target` a read-only copy with the time of `source`; where the disk can share blocks, it takes no space."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with temporary_name(target) as scratch:
        with source.open("rb") as old, scratch.open("wb") as new:
            if not platforms.share_blocks(old, new):
                shutil.copyfileobj(old, new, PIECE)
        status = source.stat()
        os.utime(scratch, ns=(status.st_atime_ns, status.st_mtime_ns))
        scratch.chmod(0o444)
        platforms.replace(scratch, target)


def is_copy(source: Path, target: Path) -> bool:
    """Return True when `target` is as `copy` left it: a file of its own, of equal size and time."""
    try:
        old, new = source.stat(), target.stat()
    except OSError:
        return False
    separate = (old.st_dev, old.st_ino) != (new.st_dev, new.st_ino)
    return separate and (old.st_size, old.st_mtime_ns) == (new.st_size, new.st_mtime_ns)


@contextlib.contextmanager
def temporary_name(path: Path) -> Iterator[Path]:
    """Yield a name next to `path` that no other process uses; remove the file at the end, also after an error."""
    stem = path.name.lstrip(".").partition(".")[0]
    scratch = path.with_name(f".{stem}.{_host()}-{os.getpid()}.{os.urandom(4).hex()}.tmp")
    try:
        yield scratch
    finally:
        # on Windows, open in a library that failed: `remove_leftovers` removes it
        with contextlib.suppress(PermissionError):
            platforms.remove(scratch)


@contextlib.contextmanager
def disk_limits(folder: Path) -> Iterator[None]:
    """Convert OSError of writing to ResourceError, with the limit of the machine in words."""
    try:
        yield
    except OSError as error:
        why = "the disk is full or a file size limit was reached" if error.errno in FULL else str(error.strerror)
        raise ResourceError(f"cannot write below {folder}: {why}; no partial file remains") from None


@contextlib.contextmanager
def hold_lock(path: Path, *, wait: bool = True, waiting: Callable[[], None] = lambda: None) -> Iterator[bool]:
    """Yield True when this process holds the lock file, and remove it after; call `waiting` before any wait.

    The operating system drops the lock of a process that dies, whatever ended it.
    """
    from filelock import FileLock  # here, since a command whose results are all up to date locks nothing

    platforms.set_aside(path)
    lock = FileLock(path, thread_local=False, fallback_to_soft=False)
    held = _acquire(lock, wait=False)
    if held is None and wait:
        waiting()
        held = _acquire(lock, wait=True)
    try:
        yield held is not None
    finally:
        remains = held is not None and not _remove(path)  # while held: waiting processes then look for the file again
        lock.release()
        if remains:  # Windows removes no open file; this attempt, too, fails where another process now holds the lock
            _remove(path)


def _remove(path: Path) -> bool:
    """Remove a file; return True when it no longer exists."""
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return False
    return True


def _acquire(lock: FileLock, *, wait: bool) -> FileLock | None:
    """Return the lock, or None when another process holds it.

    A file system without locks counts as free: unique temporary names and atomic replacement keep results correct, but
    work may then be done twice.
    """
    from filelock import Timeout

    try:
        lock.acquire(blocking=wait)
    except Timeout:
        return None
    except OSError as error:
        if error.errno not in LOCKLESS:
            raise
    return lock


def remove_leftovers(root: Path) -> int:
    """Remove temporary files and locks of ended processes below `root`, and unfinished work that nobody has continued
    for long; return the number of removed files."""
    removed = 0
    for folder, _, names in os.walk(root):
        for name in names:
            if not name.endswith((".tmp", ".part", ".lock")):
                continue
            path = Path(folder, name)
            if (name.endswith(".tmp") and _is_abandoned(path)) or (name.endswith(".part") and _is_old(path)):
                with contextlib.suppress(OSError):  # the folder is read-only, or another process removes the file
                    path.unlink()
                    removed += 1
            elif name.endswith(".lock"):
                with contextlib.suppress(OSError), hold_lock(path, wait=False) as held:
                    removed += held  # its release removes it
    return removed


def _is_abandoned(path: Path) -> bool:
    match = _TEMPORARY.fullmatch(path.name)
    if match is None:
        return False  # not a file of this program
    if match["host"] != _host():
        return _is_old(path)
    return not platforms.is_alive(int(match["pid"]))


def _is_old(path: Path) -> bool:
    with contextlib.suppress(OSError):
        # a week: age at which temporary files of other machines that share the disk, and unfinished work, are
        # removed [s]
        return time.time() - path.stat().st_mtime > 7 * 86400.0
    return False


@cache
def _host() -> str:
    return sha256(platform.node().encode())[:8]
