"""Differences between Linux, macOS and Windows. No other module depends on the operating system.

Modules that only some systems have are imported here at their use; their absence is no error.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path
from typing import Any


def _module(name: str) -> Any:
    """Return a module that only some systems have; None elsewhere."""
    try:
        return __import__(name)
    except ImportError:
        return None


def cores() -> int:
    """Return the number of processors that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def memory() -> int:
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


def replace(scratch: Path, path: Path) -> None:
    """Rename a file to `path`, also over a read-only file, which Windows does not replace."""
    if os.name == "nt" and path.is_file():
        path.chmod(stat.S_IREAD | stat.S_IWRITE)
    os.replace(scratch, path)


def plain_output() -> None:
    """Let consoles with old code pages print unknown characters as escapes instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _text(path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except OSError:
        return ""
