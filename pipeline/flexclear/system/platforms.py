"""Differences between Linux, macOS and Windows. No other module depends on the operating system.

Modules that only some systems have are imported here at their use; their absence is no error.
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

from flexclear.system.log import LOG

#: ioctl request by which a file shares the blocks of another until one of them is written (linux/fs.h)
FICLONE = 0x40049409
#: time to wait for a file that another program has open, and time between two attempts [s]
WAIT_FOR_FILE, PAUSE = 2.0, 0.05


def _module(name: str) -> Any:
    """Return a module that only some systems have; None elsewhere."""
    try:
        return __import__(name)
    except ImportError:
        return None


def count_cores() -> int:
    """Return the number of processors that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def available_memory() -> int:
    """Return the memory that this process can still get [bytes]: least of machine, container and its own limit."""
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
    """Return the largest resident memory of this process so far [B]; 0 where the system does not report it."""
    resource = _module("resource")
    if resource is None:
        return 0
    peak: int = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def share_blocks(source: Any, target: Any) -> bool:
    """Let an open file share the blocks of another (Linux, on some file systems); return True on success."""
    fcntl = _module("fcntl")
    if fcntl is None or sys.platform != "linux":
        return False
    try:
        fcntl.ioctl(target.fileno(), FICLONE, source.fileno())
    except OSError:
        return False
    return True


def replace(scratch: Path, path: Path) -> None:
    """Rename a file to `path` and replace the file there, also if it is read-only or briefly open on Windows."""
    set_aside(path)
    _retry(lambda: os.replace(scratch, path), path)


def set_aside(path: Path) -> None:
    """Rename a folder at the path of a file, and say so: this program creates no such folder, it is the user's."""
    if path.is_dir() and not path.is_symlink():
        number = itertools.count(1)
        while (other := path.with_name(f"{path.name}.folder{next(number)}")).exists():
            pass
        os.replace(path, other)
        LOG.warning(f"{path} was a folder in the place of a file of results; the folder is now {other.name}")


def remove(path: Path) -> None:
    """Remove a file if it exists, also if it is read-only or briefly open on Windows."""
    with contextlib.suppress(FileNotFoundError):
        _retry(lambda: os.unlink(path), path)


def _retry(change: Callable[[], None], path: Path) -> None:
    """Repeat a change that removes a file: a program with the file open (viewer, virus scanner) may close it soon."""
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
    """Force the names in a folder to the disk, where the system and the file system support that."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def others_can_write(folder: Path, *, inside: bool) -> bool:
    """Return True when other users can write to a folder, or it belongs neither to this user nor to the system.

    inside: whether the folder's content must be safe, not only the folder's name. Where folders have no numeric owner
    (Windows), the user's own folders are closed to others.
    """
    if not hasattr(os, "geteuid"):
        return False
    status = folder.stat()
    open_to_all = bool(status.st_mode & stat.S_IWOTH) and not (status.st_mode & stat.S_ISVTX and not inside)
    return open_to_all or bool(inside and status.st_mode & stat.S_IWGRP) or status.st_uid not in (0, os.geteuid())


def is_alive(process: int) -> bool:
    """Return True when a process with this number runs, as far as this user can see."""
    import psutil

    try:
        return psutil.pid_exists(process)
    except OverflowError:  # no system has such a number
        return False


def plain_output() -> None:
    """Let consoles with old code pages print unknown characters as escapes instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def reader_has_gone() -> bool:
    """Return True when nobody reads the output any more, as after `| head`, or the system does not say."""
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
