"""Memory and disk that this machine has left, checked before work that needs more."""

from __future__ import annotations

import os
import shutil
from functools import cache
from pathlib import Path

from flexclear.system.errors import ResourceError
from flexclear.system.platforms import available_memory

__all__ = ["available_memory", "free_disk_space", "instruction_set", "require_disk", "require_memory", "size_text"]

#: instruction sets that change the rounding of sums and products, by their names in LLVM
INSTRUCTIONS = ("avx512f", "avx2", "fma", "neon", "sve")
#: environment variables that select other instructions
CHOOSING = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT", "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")

#: fraction of the remaining memory or disk that one piece of work may take
ALLOWED_FRACTION = 0.8


def free_disk_space(folder: Path) -> int:
    """Return the free space of the disk that holds, or will hold, a folder [bytes]."""
    return shutil.disk_usage(next(p for p in (folder, *folder.parents) if p.is_dir())).free


def require_memory(need: float, what: str, remedy: str, limit: float | None = None) -> None:
    """Raise ResourceError when `what` needs more memory than `limit` [bytes]; default: a fraction of what is left."""
    allowed = ALLOWED_FRACTION * available_memory() if limit is None else limit
    if need > allowed:
        raise ResourceError(
            f"{what} takes about {size_text(need)} of memory, more than the {size_text(allowed)} allowed; {remedy}"
        )


def require_disk(need: float, what: str, folder: Path, remedy: str, limit: float | None = None) -> None:
    """Raise ResourceError when `what` needs more disk space than allowed [bytes]; limit: as in `require_memory`."""
    allowed = ALLOWED_FRACTION * free_disk_space(folder) if limit is None else limit
    if need > allowed:
        raise ResourceError(
            f"{what} takes about {size_text(need)} of disk space in {folder}, more than "
            f"the {size_text(allowed)} allowed; {remedy}"
        )


def size_text(count: float) -> str:
    """Return a number of bytes in words: ``3.2 GB``."""
    power = next((k for k in range(5) if count < 1000.0 ** (k + 1)), 4)
    return f"{count / 1000.0**power:.3g} {('B', 'kB', 'MB', 'GB', 'TB')[power]}"


@cache
def instruction_set() -> dict[str, str]:
    """Return what decides the rounding of results on this machine, in words: processor, vector units, settings.

    It is not part of any key: results of other processors differ within the tolerances of their runs.
    """
    import llvmlite.binding as llvm  # here, since only runs need it

    features = llvm.get_host_cpu_features()
    vectors = ", ".join(name for name in INSTRUCTIONS if features.get(name)) or "none of " + ", ".join(INSTRUCTIONS)
    facts = {"processor": llvm.get_host_cpu_name(), "instructions": vectors}
    return facts | {name: os.environ[name] for name in CHOOSING if os.environ.get(name)}
