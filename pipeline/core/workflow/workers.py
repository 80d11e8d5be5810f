"""Worker processes of this machine: spawned, ended with their parent, deaf to Ctrl-C, which is left to the parent."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING

from flexclear.pipeline.core.workflow.family import follow

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor


def pool(width: int) -> ProcessPoolExecutor:
    """That many workers at most; spawned, because compiled kernels and forks do not mix."""
    # imported here, because a run that finds everything fresh must start quickly
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(width, mp_context=context, initializer=follow, initargs=(os.getpid(),))


def kill(workers: ProcessPoolExecutor) -> None:
    """End the workers at once; a compiled kernel does not listen to interrupts."""
    for process in list((workers._processes or {}).values()):
        process.kill()
    workers.shutdown(wait=False, cancel_futures=True)


@contextmanager
def without_main() -> Iterator[None]:
    """Workers that are started meanwhile do not run the caller's script again from its top, as they would else."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
