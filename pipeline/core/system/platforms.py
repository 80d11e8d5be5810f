"""What systems do differently: Linux, macOS, Windows. Nothing else of this program asks on which one it runs.

Modules that only some systems have are imported here, where they are used, and their absence is no error.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import stat
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: the request that lets a file share the bytes of another until one of them is written (linux/fs.h)
FICLONE = 0x40049409
#: how long a file is awaited that another program has open, and between two attempts [s]
WAIT_FOR_FILE, PAUSE = 2.0, 0.05


def _module(name: str) -> Any:
    """A module of some systems; None elsewhere."""
    try:
        return __import__(name)
    except ImportError:
        return None


def cores() -> int:
    """Processors that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def memory() -> int:
    """Bytes that this process can still get: of the machine, of its container, of its own limit."""
    import psutil

    bounds = [psutil.virtual_memory().available]
    limit, used = _text("/sys/fs/cgroup/memory.max"), _text("/sys/fs/cgroup/memory.current")
    if limit.isdigit() and used.isdigit():
        bounds.append(int(limit) - int(used))
    resource = _module("resource")
    if resource is not None:
        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        bounds += [soft] if soft != resource.RLIM_INFINITY else []
    return max(0, min(bounds))


def peak_memory() -> int:
    """Largest resident memory of this process so far [B]; 0 where the system does not report it."""
    resource = _module("resource")
    if resource is None:
        return 0
    peak: int = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def share_blocks(source: Any, target: Any) -> bool:
    """Whether an open file could be made to share the bytes of another (Linux, on file systems that can)."""
    fcntl = _module("fcntl")
    if fcntl is None or sys.platform != "linux":
        return False
    try:
        fcntl.ioctl(target.fileno(), FICLONE, source.fileno())
    except OSError:
        return False
    return True


def replace(made: Path, path: Path) -> None:
    """Give a file the name of another one, which is gone: Windows keeps what is read-only, and what is open."""
    set_aside(path)
    _insist(lambda: os.replace(made, path), path)


def set_aside(path: Path) -> None:
    """Rename a folder that has the name of a file: nothing of ours makes one, and what it holds may be somebody's."""
    if path.is_dir() and not path.is_symlink():
        number = itertools.count(1)
        while (other := path.with_name(f"{path.name}.folder{next(number)}")).exists():
            pass
        os.replace(path, other)


def remove(path: Path) -> None:
    """Remove a file where there is one, under the same conditions."""
    with contextlib.suppress(FileNotFoundError):
        _insist(lambda: os.unlink(path), path)


def _insist(change: Callable[[], None], path: Path) -> None:
    """Do what takes a file away; whoever has it open (a viewer, an indexer, a virus scanner) may let it go soon."""
    end = time.monotonic() + WAIT_FOR_FILE
    while True:
        try:
            return change()
        except PermissionError as error:
            if not path.is_file() or not os.access(path.parent, os.W_OK):
                raise
            if not path.stat().st_mode & stat.S_IWRITE:
                path.chmod(stat.S_IREAD | stat.S_IWRITE)
            elif time.monotonic() > end:
                why = f"{path.name} is protected, or open in another program"
                raise PermissionError(error.errno, why, str(path)) from None
            else:
                time.sleep(PAUSE)


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to the disk, where folders can be opened, and the file system knows such a thing."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def others_can_write(folder: Path, *, inside: bool) -> bool:
    """Whether anybody but this user and the system's can write to a folder, or it is not theirs.

    inside: whether what lies in it counts, not only its replacement.  Where folders belong to nobody by number
    (Windows) the user's own folders are closed to others.
    """
    if not hasattr(os, "geteuid"):
        return False
    status = folder.stat()
    open_to_all = bool(status.st_mode & stat.S_IWOTH) and not (status.st_mode & stat.S_ISVTX and not inside)
    return open_to_all or bool(inside and status.st_mode & stat.S_IWGRP) or status.st_uid not in (0, os.geteuid())


def alive(process: int) -> bool:
    """Whether a process of this number runs, for all that this user may know."""
    import psutil

    try:
        return psutil.pid_exists(process)
    except OverflowError:  # no system has such a number
        return False


def plain_output() -> None:
    """Let consoles of old code pages show what they cannot show as escapes, instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def reader_has_gone() -> bool:
    """Return whether nobody reads the output any more, as after `| head`; True where the system does not say."""
    try:
        import select

        look = select.poll()
        for stream in (sys.stdout, sys.stderr):
            look.register(stream.fileno(), 0)
        return any(event & (select.POLLERR | select.POLLHUP) for _, event in look.poll(0))
    except (ImportError, AttributeError, OSError, ValueError):
        return True


def _text(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except OSError:
        return ""
