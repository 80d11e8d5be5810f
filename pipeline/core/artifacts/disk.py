"""Files that are there in full or not at all, that carry their own digest, that are shown as copies; locks; sweeping.

Temporary files and locks of a process that died are left behind, whatever it died of; `sweep` knows them by the name
of their owner, or by nobody holding them.
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

from flexclear.pipeline.core.system import platforms
from flexclear.pipeline.core.system.errors import ResourceError

if TYPE_CHECKING:
    from filelock import FileLock

#: bytes that no table of records, facts or imports has
LARGEST_TABLE = 64 << 20
#: bytes that are copied at once: more are new to memory each time, which takes longer than to copy them
PIECE = 1 << 17
#: what a full or limited disk answers
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
#: temporary files of other machines that share the disk, and unfinished work, are swept when they are so old [s]
FORGOTTEN = 7 * 86400.0
#: what a file system without locks answers
LOCKLESS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
_TEMPORARY = re.compile(r"\.(?P<stem>[^.]*)\.(?P<host>[0-9a-f]{8})-(?P<pid>\d+)\.[0-9a-f]{8}\.tmp")


def sha256(content: bytes) -> str:
    """Hexadecimal digest."""
    return hashlib.sha256(content).hexdigest()


def require_ordinary(path: Path) -> int:
    """Bytes of a file; OSError for a folder, a device, which may have no end, or a pipe, which waits for a writer."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is no ordinary file", str(path))
    return status.st_size


def read_whole(path: Path, largest: int | None = None) -> bytes:
    """What an ordinary file holds; OSError for others, and for more bytes than `largest`."""
    size = require_ordinary(path)
    if largest is not None and size > largest:
        raise OSError(errno.EFBIG, f"it is larger than {largest} bytes", str(path))
    return path.read_bytes()


def digest_of(path: Path) -> str:
    """The sha256 of an ordinary file, however large; OSError for others."""
    require_ordinary(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def publish(path: Path, content: bytes) -> str:
    """Write a file so that it is either there in full or not at all; returns its sha256."""
    with temporary(path) as made:
        made.write_bytes(content)
        if made.read_bytes() != content:
            raise OSError(errno.EIO, "what was written does not read back", str(path))
        digest = settle(made, path)
    platforms.sync_folder(path.parent)
    return digest


def settle(made: Path, path: Path) -> str:
    """Force the bytes of a file to the disk and give it its name; returns its sha256.

    The name is on the disk after `platforms.sync_folder`, together with all others of its folder.
    """
    with made.open("rb+") as file:  # Windows forces only what could be written
        os.fsync(file.fileno())
    digest = digest_of(made)
    platforms.replace(made, path)
    return digest


def checked(table: Mapping[str, Any]) -> bytes:
    """A table as a file that carries its own digest: ``{"content": ..., "sha256": ...}``."""
    whole = {"content": table, "sha256": _digest(table)}
    return json.dumps(whole, indent=1, sort_keys=True, ensure_ascii=False).encode() + b"\n"


def read_checked(path: Path) -> dict[str, Any] | None:
    """The table in a file that `checked` made; None when there is none or one bit of it has changed."""
    try:
        whole = json.loads(read_whole(path, LARGEST_TABLE))
        table = whole["content"]
        return dict(table) if whole["sha256"] == _digest(table) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _digest(table: Mapping[str, Any]) -> str:
    return sha256(json.dumps(table, sort_keys=True, ensure_ascii=False).encode())


def copy(source: Path, target: Path) -> None:
    """Let `target` be a read-only copy with the time of `source`; it takes no space where the disk can share bytes."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with temporary(target) as made:
        with source.open("rb") as old, made.open("wb") as new:
            if not platforms.share_blocks(old, new):
                shutil.copyfileobj(old, new, PIECE)
        status = source.stat()
        os.utime(made, ns=(status.st_atime_ns, status.st_mtime_ns))
        made.chmod(0o444)
        platforms.replace(made, target)


def is_copy(source: Path, target: Path) -> bool:
    """Whether `target` is as `copy` left it: of its own, of equal size and time."""
    try:
        old, new = source.stat(), target.stat()
    except OSError:
        return False
    separate = (old.st_dev, old.st_ino) != (new.st_dev, new.st_ino)
    return separate and (old.st_size, old.st_mtime_ns) == (new.st_size, new.st_mtime_ns)


@contextlib.contextmanager
def temporary(path: Path) -> Iterator[Path]:
    """A name next to `path` that no other process uses; gone afterwards, however it ends."""
    stem = path.name.lstrip(".").partition(".")[0]
    made = path.with_name(f".{stem}.{_host()}-{os.getpid()}.{os.urandom(4).hex()}.tmp")
    try:
        yield made
    finally:
        with contextlib.suppress(PermissionError):  # a library that failed has it still open, on Windows: `sweep` will
            platforms.remove(made)


@contextlib.contextmanager
def disk_limits(folder: Path) -> Iterator[None]:
    """OSError on the way to disk, as a limit of the machine, in words."""
    try:
        yield
    except OSError as error:
        why = "the disk is full or a file size limit was reached" if error.errno in FULL else str(error.strerror)
        raise ResourceError(f"cannot write below {folder}: {why}; nothing half-written was left") from None


@contextlib.contextmanager
def locked(path: Path, *, wait: bool = True, waiting: Callable[[], None] = lambda: None) -> Iterator[bool]:
    """Whether this process has the lock of a file, which is gone afterwards; `waiting` is called before it waits.

    The system drops the lock of a process that dies, whatever it dies of.
    """
    from filelock import FileLock  # here, since what finds everything fresh locks nothing

    platforms.set_aside(path)
    lock = FileLock(path, thread_local=False, fallback_to_soft=False)
    mine = _acquire(lock, wait=False)
    if mine is None and wait:
        waiting()
        mine = _acquire(lock, wait=True)
    try:
        yield mine is not None
    finally:
        stays = mine is not None and not _unlinked(path)  # while it is held: who waits will look for the file again
        lock.release()
        if stays:  # Windows removes no file that is open; nor this one, where somebody else holds it by now
            _unlinked(path)


def _unlinked(path: Path) -> bool:
    """Whether there is no such file any more."""
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return False
    return True


def _acquire(lock: FileLock, *, wait: bool) -> FileLock | None:
    """The lock, or None when another process holds it.

    A file system without locks counts as free: unique temporary names and atomic replacement keep results right, work
    may then be done twice.
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


def sweep(root: Path) -> int:
    """Remove temporary files and locks below `root` that processes left which are no more, and unfinished work that
    nobody has continued for long; how many."""
    removed = 0
    for folder, _, names in os.walk(root):
        for name in names:
            if not name.endswith((".tmp", ".part", ".lock")):
                continue
            path = Path(folder, name)
            if (name.endswith(".tmp") and _abandoned(path)) or (name.endswith(".part") and _old(path)):
                with contextlib.suppress(OSError):  # nothing can be written there, or another sweeps
                    path.unlink()
                    removed += 1
            elif name.endswith(".lock"):
                with contextlib.suppress(OSError), locked(path, wait=False) as mine:
                    removed += mine  # gone when it is released
    return removed


def _abandoned(path: Path) -> bool:
    match = _TEMPORARY.fullmatch(path.name)
    if match is None:
        return False  # none of ours
    if match["host"] != _host():
        return _old(path)
    return not platforms.alive(int(match["pid"]))


def _old(path: Path) -> bool:
    with contextlib.suppress(OSError):
        return time.time() - path.stat().st_mtime > FORGOTTEN
    return False


@cache
def _host() -> str:
    return sha256(platform.node().encode())[:8]
