"""Folder of compiled kernels: its owner, its processor, and the limit of its size.

Loading a kernel runs code, so a folder in which other users could write is refused.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from flexclear.artifacts.disk import remove_leftovers
from flexclear.dynamics.compile.files import CODE, file_lock, remove_code
from flexclear.dynamics.kernels import PLAIN
from flexclear.system.errors import InputError
from flexclear.system.platforms import others_can_write

#: kernels unused for this time [s] are removed, and the least recently used ones beyond this many bytes
UNUSED, LARGEST = 90 * 86400.0, 2 << 30


def writable(root: Path, report: Callable[[str], None]) -> Path:
    """Return the folder for this processor below `root`; if it cannot be written, a temporary one of this process.

    Raises InputError when other users could write there.
    """
    folder = root / processor()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        problem = "" if os.access(folder, os.W_OK) else "not writable"
    except OSError as error:
        problem = error.strerror or str(error)
    if problem:
        report(f"compiled kernels cannot be stored in {folder} ({problem}); every process will compile its own")
        return Path(_temporary_folder().name)
    refuse_shared(folder)
    return folder


def refuse_shared(folder: Path) -> None:
    """Raise InputError when anyone but this user and the system's can write to a folder of kernels, or replace it."""
    for part in (folder, *folder.parents):
        if others_can_write(part, inside=part == folder):
            raise InputError(
                str(folder),
                f"compiled kernels are not loaded from this folder, since others can write to {part}",
                f"chmod go-w {part}, or name another folder with FLEXCLEAR_KERNELS",
            )


@cache
def processor() -> str:
    """Return a name for the target of compiled code: processor, its features and the compiler's settings for them."""
    import llvmlite.binding as llvm

    settings = [os.environ.get(f"NUMBA_{name}", "") for name in ("CPU_NAME", "CPU_FEATURES", "OPT")]
    facts = (llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten(), *settings, *["plain"][: int(PLAIN)])
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:12]


def prune(folder: Path, unused: float = UNUSED, largest: int = LARGEST) -> int:
    """Remove kernels unused for `unused` seconds, then the oldest beyond `largest` bytes; return their number."""
    remove_leftovers(folder)
    files = [*folder.glob("flexclear_*.py"), *folder.glob(f"flexclear_routine_*{CODE}")]
    kernels = [(_last_use(path), path) for path in files]
    total, removed = 0, 0
    for used, path in sorted(kernels, reverse=True):
        total += size(path)
        if (total > largest or time.time() - used > unused) and _remove_kernel(path):
            removed += 1
    return removed


def size(path: Path) -> int:
    """Return the bytes of a generated file and its compiled code, or of the code of a routine."""
    return sum(file.stat().st_size for file in {path, path.with_suffix(CODE)} if file.is_file())


def _last_use(path: Path) -> float:
    """Return the time of a kernel's last use, or of its source while it is being compiled (no checksum yet)."""
    noted = path.with_suffix(".sum")
    return (noted if noted.is_file() else path).stat().st_mtime


def _remove_kernel(path: Path) -> bool:
    """Remove a kernel, unless another process is compiling it; return True if removed."""
    with file_lock(path, wait=False) as mine:
        if mine:
            remove_code(path)
            path.unlink(missing_ok=True)
    return mine


@cache
def _temporary_folder() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="flexclear_kernels_")
