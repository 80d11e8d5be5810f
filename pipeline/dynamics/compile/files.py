"""Generated files, imported: the function of each is compiled as that is done, or fetched from disk.

To load what was compiled is to run it, so it is loaded only if every file of it, the compiler's index included, has
the digest that was noted when it was made. What is damaged, half written or cannot be loaded is set aside and compiled
again. A file belongs to whoever holds its lock, so that no two processes compile the same. The second process
(`compiler_process`) imports this module and little else.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import ModuleType

from numba import config
from numba.core.bytecode import FunctionIdentity

from flexclear.pipeline.core.artifacts.disk import checked, locked, publish, read_checked

#: told the file that has to be compiled, or waited for
Tell = Callable[[Path], None]


def bring(paths: list[Path], tell: Tell) -> None:
    """Import files, compiling them in this order; those that another process is compiling come last."""
    left = list(paths)
    while left:
        path = next((path for path in left if take(path, tell)), left[0])
        if path.stem not in sys.modules:
            tell(path)
            take(path, lambda _: None, wait=True)
        left.remove(path)


def take(path: Path, tell: Tell, *, wait: bool = False) -> bool:
    """Import a file; False, and nothing done, when another process has its lock and it is not to be waited for."""
    if _fetched(path):
        return True
    with claimed(path, wait=wait) as mine:
        if mine and not _fetched(path):
            tell(path)
            set_aside(path)
            _import(path)
            if not config.DISABLE_JIT:
                publish(path.with_suffix(".sum"), checked(_digests(path)))
    return mine


def compiled(path: Path) -> bool:
    """Whether the code of a file is on disk, every byte as it was written."""
    noted = read_checked(path.with_suffix(".sum"))
    return noted is not None and noted == _digests(path)


def set_aside(path: Path) -> None:
    """Remove what was compiled of a file."""
    for found in (path.with_suffix(".sum"), *_code(path)):
        found.unlink(missing_ok=True)


def _fetched(path: Path) -> bool:
    """Import a file whose code is on disk; False when it is not, or cannot be loaded for whatever reason."""
    if not compiled(path):
        return False
    try:
        _import(path)
    except Exception:
        return False
    with contextlib.suppress(OSError):
        os.utime(path.with_suffix(".sum"))  # used: not to be pruned
    return True


def _code(path: Path) -> list[Path]:
    """What the compiler has written of a file: index and code."""
    return sorted((path.parent / "__pycache__").glob(f"{path.stem}.*"))


def _digests(path: Path) -> dict[str, str]:
    """Of the source and of all that was compiled of it, by name."""
    return {found.name: hashlib.sha256(found.read_bytes()).hexdigest() for found in (path, *_code(path))}


def claimed(path: Path, *, wait: bool) -> AbstractContextManager[bool]:
    """Whether this process has the lock beside a file, which ends with it; of two the second waits, or goes without."""
    return locked(path.with_suffix(".lock"), wait=wait)


def _import(path: Path) -> None:
    """Run the source itself: Python would keep bytecode of it, and take that without looking."""
    code = compile(path.read_bytes(), str(path), "exec")
    sys.modules[path.stem] = module = ModuleType(path.stem)  # what is on disk refers to it
    module.__file__ = str(path)
    _number_apart()
    try:
        with _kept_beside():
            exec(code, module.__dict__)
    except BaseException:  # interrupted, or no room on the disk: not to be taken for whole later
        del sys.modules[path.stem]
        raise


@contextmanager
def _kept_beside() -> Iterator[None]:
    """Let Numba look for code beside the source and nowhere else, whatever its own settings say."""
    before = config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES
    config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = "", "InTreeCacheLocator"
    try:
        yield
    finally:
        config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = before


def _number_apart() -> None:
    """Let Numba's names be those of no other process.

    It names the code of a function by its qualified name and a counter of the process. Files that
    two processes compiled would share names for different code, and a third process that loads
    both would mix them up (numba issue 10486); so the counter starts anywhere.
    """
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6), "big") << 16)
