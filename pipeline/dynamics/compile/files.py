"""Generated files, brought: the function of each is compiled, or its code is fetched from disk.

To load what was compiled is to run it, so it is loaded only if source and code have the digests that were noted when
it was made. What is damaged, half written or cannot be loaded is set aside and compiled again. A file belongs to
whoever holds its lock, so that no two processes compile the same. The second process (`compiler_process`) imports this
module and little else.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.artifacts.disk import checked, locked, publish, read_checked
from flexclear.pipeline.dynamics.compile import machine_code
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.specialise.tape import UnsuitedError

#: receives the file that has to be compiled, or waited for
Tell = Callable[[Path], None]
#: functions of this process by the name of their file
loaded: dict[str, machine_code.Code] = {}
#: functions of Python by their numbers, where nothing is compiled
interpreted: dict[int, Callable] = {}
CODE = ".code"  #: what was compiled of a file
#: arguments of compiled functions, which return an integer: pointers to integers (I) and floats (F), an integer (i), a
#: float (f).  After h, f, w, n: t, y, dy, and a tolerance; y, retractment, out, total; t; nothing; rows and pieces with
#: their shapes, tolerance, out with its length; t, repeat, outputs with their number, rows, events; step, t_new, rows,
#: events.  Of several lanes: table, places, numbers
SIGNATURES = {
    "evaluate": "IFFI fii",
    "project": "IFFI fiif",
    "retract": "IFFI iiii",
    "prescribe": "IFFI f",
    "describe": "IFFI",
    "observe": "IFFI Fii Iii fFi",
    "advance": "IFFI fi Fi Fii Fii",
    "resolve": "IFFI ff Fii Fii",
    "lanes": "IIF",
}


def bring(paths: list[Path], tell: Tell) -> None:
    """Load files, compiling them in this order; those that another process is compiling come last."""
    left = list(paths)
    while left:
        path = next((path for path in left if take(path, tell)), None)
        if path is None:
            path = left[0]
            tell(path)
            take(path, lambda _: None, wait=True)
        left.remove(path)


def take(path: Path, tell: Tell, *, wait: bool = False) -> bool:
    """Load a file; False, and nothing done, when another process has its lock and it is not to be waited for."""
    if _fetched(path):
        return True
    with claimed(path, wait=wait) as mine:
        if mine and not _fetched(path):
            tell(path)
            set_aside(path)
            _compile(path)
    return mine


def compiled(path: Path) -> bool:
    """Whether the code of a file is on disk, every byte as it was written."""
    noted = read_checked(path.with_suffix(".sum"))
    return noted is not None and noted == _digests(path)


def set_aside(path: Path) -> None:
    """Remove what was compiled of a file."""
    for suffix in (".sum", CODE):
        path.with_suffix(suffix).unlink(missing_ok=True)


def _fetched(path: Path) -> bool:
    """Load a file whose code is on disk; False when it is not, or cannot be loaded for whatever reason."""
    if INTERPRETED or not compiled(path):
        return False
    try:
        # another thread may have loaded it meanwhile, and be in it
        loaded.setdefault(path.stem, machine_code.load(path.with_suffix(CODE).read_bytes()))
    except Exception:
        return False
    with contextlib.suppress(OSError):
        os.utime(path.with_suffix(".sum"))  # used: not to be pruned
    return True


def of_another_build(path: Path) -> bool:
    """Whether what was compiled of a file is kept as another build of the program does: it is whole, and not used."""
    noted = read_checked(path.with_suffix(".sum"))
    return noted is not None and set(noted) != {path.name, path.with_suffix(CODE).name}


def _digests(path: Path) -> dict[str, str]:
    """Of the source and of the code that was made of it, by name."""
    there = (file for file in (path, path.with_suffix(CODE)) if file.is_file())
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in there}


def claimed(path: Path, *, wait: bool) -> AbstractContextManager[bool]:
    """Whether this process has the lock next to a file, which ends with it; of two the second waits, or goes
    without."""
    return locked(path.with_suffix(".lock"), wait=wait)


def compiles(compiler: Callable[[Callable], Any]) -> Callable[[Callable], int]:
    """Decorator of the function of a generated file: it is compiled at once; its address.

    compiler: what makes a C function of it (`numba.cfunc`).
    """

    def compiled_function(function: Callable) -> int:
        if INTERPRETED:
            interpreted[id(function)] = function
            made = machine_code.Code(id(function), function)
        else:
            done = compiler(function)
            made = machine_code.Code(done.address, done)
        loaded[function.__globals__["__name__"]] = made
        return made.address

    return compiled_function


def assembles(name: str, function: str, code: Callable[[], str], level: int) -> None:
    """Make the function of a generated file of LLVM's text for it; there is none where that is not suited.

    name: of the file.  level: as of `machine_code.assembled`.
    """
    try:
        image = machine_code.stored(function, *machine_code.assembled(code(), level, optimised=False))
    except UnsuitedError:
        image = machine_code.NOTHING
    loaded[name] = replace(machine_code.load(image), image=image)


def _compile(path: Path) -> None:
    """Compile a file and leave its code on disk."""
    try:
        with _without_collector():
            # the source itself: Python would keep bytecode of it, and take that without looking
            exec(compile(path.read_bytes(), str(path), "exec"), {"__name__": path.stem, "__file__": str(path)})
        if not INTERPRETED:
            made = loaded[path.stem]
            publish(path.with_suffix(CODE), made.image or machine_code.image(made.keeper))
            publish(path.with_suffix(".sum"), checked(_digests(path)))
    except BaseException:  # interrupted, or no room on the disk: not to be taken for whole later
        loaded.pop(path.stem, None)
        raise


@contextlib.contextmanager
def _without_collector() -> Iterator[None]:
    """Meanwhile no cycles are collected: all that a compiler makes is in use to its end.

    It saves a seventh of the time and takes some 120 MiB more at the most.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            if not gc.get_freeze_count():  # what somebody else has put aside stays there
                # old at once: to look through what was made took a third of a second after each file
                gc.freeze()
                gc.unfreeze()
            gc.enable()
