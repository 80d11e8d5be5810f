"""The folder of compiled kernels: whose it is, for which processor, and how its size is limited.

To load a kernel is to run code, so a folder in which anybody else could write is refused.
"""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from flexclear.pipeline.core.artifacts.disk import sweep
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.core.system.platforms import others_can_write
from flexclear.pipeline.dynamics.compile.files import CODE, claimed, set_aside

#: kernels that nobody fetched for so long are removed [s], and the oldest ones beyond so many bytes
UNUSED, LARGEST = 90 * 86400.0, 2 << 30


def writable(root: Path, tell: Callable[[str], None]) -> Path:
    """The folder for this processor below `root`; where it cannot be written, one that lasts as long as this process.

    Raises InputError when others could write there.
    """
    folder = root / processor()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        problem = "" if os.access(folder, os.W_OK) else "not writable"
    except OSError as error:
        problem = error.strerror or str(error)
    if problem:
        tell(f"compiled kernels cannot be kept in {folder} ({problem}); every process will compile its own")
        return Path(_temporary().name)
    refuse_shared(folder)
    return folder


def refuse_shared(folder: Path) -> None:
    """InputError when anybody but this user (and the system's) can write to a folder of kernels, or replace it."""
    for part in (folder, *folder.parents):
        if others_can_write(part, inside=part == folder):
            raise InputError(
                str(folder),
                f"compiled kernels are not loaded from there, since others can write to {part}",
                f"chmod go-w {part}, or name another folder with FLEXCLEAR_KERNELS",
            )


@cache
def processor() -> str:
    """A name for what code is compiled for: processor, its features and the compiler's settings for them."""
    import llvmlite.binding as llvm

    settings = [os.environ.get(f"NUMBA_{name}", "") for name in ("CPU_NAME", "CPU_FEATURES", "OPT")]
    facts = (llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten(), *settings)
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:12]


def prune(folder: Path, unused: float = UNUSED, largest: int = LARGEST) -> int:
    """Remove kernels that nobody has fetched for `unused` seconds, then the oldest beyond `largest` bytes; how many."""
    sweep(folder)
    kernels = [(_used(path), path) for path in folder.glob("flexclear_*.py")]
    total, removed = 0, 0
    for used, path in sorted(kernels, reverse=True):
        total += size(path)
        if (total > largest or time.time() - used > unused) and _removed(path):
            removed += 1
    return removed


def size(path: Path) -> int:
    """Bytes of a generated file and of what was compiled of it."""
    return sum(file.stat().st_size for file in (path, path.with_suffix(CODE)) if file.is_file())


def _used(path: Path) -> float:
    """When a kernel was fetched last; one that is being made has no sum yet."""
    noted = path.with_suffix(".sum")
    return (noted if noted.is_file() else path).stat().st_mtime


def _removed(path: Path) -> bool:
    """Remove a kernel, unless another process is compiling it."""
    with claimed(path, wait=False) as mine:
        if mine:
            set_aside(path)
            path.unlink(missing_ok=True)
    return mine


@cache
def _temporary() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="flexclear_kernels_")
