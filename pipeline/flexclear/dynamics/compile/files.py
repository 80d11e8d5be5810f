"""Loading of generated files: the function of each is compiled, or its code is read from disk.

Loading compiled code means running it, so code is loaded only if source and code have the digests noted when the code
was compiled. Damaged, incomplete or unloadable code is removed and compiled again. A lock per file ensures that no two
processes compile the same file. The second process (`compiler_process`) imports this module and little else.
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

from flexclear.artifacts.disk import encode_with_digest, hold_lock, publish, read_checked
from flexclear.dynamics.compile import machine_code
from flexclear.dynamics.specialise.tape import UnsuitedError

#: receives the file that has to be compiled, or that another process compiles
Report = Callable[[Path], None]
#: functions loaded in this process, by the name of their file
loaded: dict[str, machine_code.Code] = {}
CODE = ".code"  #: suffix of the compiled code of a file
PART = 32  #: bytes from a part of a list to the next
#: arguments of compiled functions, which return an integer: pointers to integers (I) and floats (F), an integer (i), a
#: float (f).  After h, f, w, n: t, y, dy, and a tolerance; t; rows and pieces with their shapes, tolerance, out with
#: its length; t, repeat, outputs with their number, rows, events; step, t_new, rows, events.  Of several lanes: table,
#: places, numbers
SIGNATURES = {
    "evaluate": "IFFI fii",
    "project": "IFFI fiif",
    "prescribe": "IFFI f",
    "observe": "IFFI Fii Iii fFi",
    "advance": "IFFI fi Fi Fii Fii",
    "resolve": "IFFI ff Fii Fii",
    "lanes": "IIF",
}


def load_files(paths: list[Path], report: Report) -> None:
    """Load files, compiling them in this order; files that another process is compiling come last."""
    left = list(paths)
    while left:
        path = next((path for path in left if load_file(path, report)), None)
        if path is None:
            path = left[0]
            report(path)
            load_file(path, lambda _: None, wait=True)
        left.remove(path)


def load_file(path: Path, report: Report, *, wait: bool = False) -> bool:
    """Load a file and return True; return False when another process has its lock and `wait` is False."""
    if _load_stored(path):
        return True
    with file_lock(path, wait=wait) as mine:
        if mine and not _load_stored(path):
            report(path)
            remove_code(path)
            _compile(path)
    return mine


def is_compiled(path: Path) -> bool:
    """Return True when the code of a file is on disk and undamaged."""
    noted = read_checked(path.with_suffix(".sum"))
    return noted is not None and noted == _digests(path)


def is_damaged(path: Path) -> bool:
    """Return True when the stored code of a file differs from its digests, which no other process is changing."""
    if is_compiled(path):
        return False
    with file_lock(path, wait=True):
        return path.with_suffix(".sum").is_file() and not is_compiled(path)


def remove_code(path: Path) -> None:
    """Remove the compiled code of a file."""
    for suffix in (".sum", CODE):
        path.with_suffix(suffix).unlink(missing_ok=True)


def _load_stored(path: Path) -> bool:
    """Load a file whose code is on disk; return False when the code is missing or cannot be loaded."""
    if not is_compiled(path):
        return False
    try:
        # another thread may have loaded the same code and be running it
        loaded.setdefault(path.stem, machine_code.load(path.with_suffix(CODE).read_bytes()))
    except Exception:
        return False
    with contextlib.suppress(OSError):
        os.utime(path.with_suffix(".sum"))  # marks it as used, against pruning
    return True


def stored_by_another_build(path: Path) -> bool:
    """Return True when a file's code is undamaged but stored as by another build of the program, and so unused."""
    noted = read_checked(path.with_suffix(".sum"))
    return noted is not None and set(noted) != {path.name, path.with_suffix(CODE).name}


def _digests(path: Path) -> dict[str, str]:
    """Return the digests of source and compiled code, those that exist, by file name."""
    there = (file for file in (path, path.with_suffix(CODE)) if file.is_file())
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in there}


def file_lock(path: Path, *, wait: bool) -> AbstractContextManager[bool]:
    """Return a context: True when this process has the lock next to a file, which ends with it; wait: for another's."""
    return hold_lock(path.with_suffix(".lock"), wait=wait)


def compiles(compiler: Callable[[Callable], Any]) -> Callable[[Callable], int]:
    """Return the decorator of a generated file's function, which compiles it at once and returns the address.

    compiler: returns a C function (`numba.cfunc`).
    """

    def compiled_function(function: Callable) -> int:
        done = compiler(function)
        loaded[function.__globals__["__name__"]] = machine_code.Code(done.address, done)
        return int(done.address)

    return compiled_function


def assembles(name: str, function: str, code: Callable[[], str], level: int) -> None:
    """Load the function of a generated file from LLVM code; without code (UnsuitedError) the address is 0.

    name: of the file.  code: returns the LLVM code.  level: as in `machine_code.assemble`.
    """
    try:
        image = machine_code.image_of_module(function, *machine_code.assemble(code(), level, optimised=False))
    except UnsuitedError:
        image = machine_code.NOTHING
    loaded[name] = replace(machine_code.load(image), image=image)


def _compile(path: Path) -> None:
    """Compile a file and write its code to disk."""
    try:
        with _without_collector():
            # compile the source itself: Python would cache bytecode and load that without checking
            exec(compile(path.read_bytes(), str(path), "exec"), {"__name__": path.stem, "__file__": str(path)})
        made = loaded[path.stem]
        publish(path.with_suffix(CODE), made.image or machine_code.image(made.keeper))
        publish(path.with_suffix(".sum"), encode_with_digest(_digests(path)))
    except BaseException:  # interrupted, or disk full: the code is incomplete
        loaded.pop(path.stem, None)
        raise


@contextlib.contextmanager
def _without_collector() -> Iterator[None]:
    """Switch off garbage collection: the compiler uses all its objects to the end.

    This saves a seventh of the time and takes at most some 120 MiB more memory.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            if not gc.get_freeze_count():  # objects that another caller froze stay frozen
                # makes new objects old: a collection that examines them took a third of a second after each file
                gc.freeze()
                gc.unfreeze()
            gc.enable()
