"""Generated files, imported: the function of each is compiled as that is done, or fetched from disk.

A file belongs to whoever holds its lock, so that no two processes compile the same. The second
process (`compiler_process`) imports this module and little else.
"""

from __future__ import annotations

import fcntl
import importlib.util
import itertools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from numba.core.bytecode import FunctionIdentity

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
    if compiled(path):
        _import(path)
        return True
    with claimed(path, wait=wait) as mine:
        if mine:
            if not compiled(path):
                tell(path)
            _import(path)
    return mine


def compiled(path: Path) -> bool:
    """Whether the code of a file is on disk."""
    return any((path.parent / "__pycache__").glob(f"{path.stem}.*.nbc"))


@contextmanager
def claimed(path: Path, *, wait: bool) -> Iterator[bool]:
    """Whether this process has the lock beside a file, which ends with it; of two the second waits, or goes without."""
    with path.with_suffix(".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
            mine = True
        except BlockingIOError:
            mine = False
        yield mine


def _import(path: Path) -> None:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[path.stem] = module = importlib.util.module_from_spec(spec)  # what is on disk refers to it
    _number_apart()
    try:
        spec.loader.exec_module(module)
    except BaseException:  # interrupted, or no room on the disk: not to be taken for whole later
        del sys.modules[path.stem]
        raise


def _number_apart() -> None:
    """Let Numba's names be those of no other process.

    It names the code of a function by its qualified name and a counter of the process. Files that
    two processes compiled would share names for different code, and a third process that loads
    both would mix them up (numba issue 10486); so the counter starts anywhere.
    """
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6), "big") << 16)
