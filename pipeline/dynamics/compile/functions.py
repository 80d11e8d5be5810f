"""The compiled functions of a mechanism, cached on disk across processes.

Each is a generated file (`sources`) whose name is a digest of the sources of all kernels it can
reach and of the versions of the compiler. The functions call each other by address (`calls`), so
that mechanisms use common ones.
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from threading import Lock
from types import MappingProxyType
from typing import Any
from weakref import finalize

import numpy as np

from flexclear.pipeline.core.artifacts.disk import disk_limits, publish
from flexclear.pipeline.core.artifacts.paths import kernel_root
from flexclear.pipeline.core.workflow.encounters import meet
from flexclear.pipeline.core.workflow.fingerprint import library_version
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import reach, sources
from flexclear.pipeline.dynamics.compile.compiler_process import second_process
from flexclear.pipeline.dynamics.compile.files import SIGNATURES, bring, compiled, interpreted, loaded
from flexclear.pipeline.dynamics.compile.folder import prune, writable
from flexclear.pipeline.dynamics.compile.sources import DESCRIBED, SPECIALISED, WHOLE
from flexclear.pipeline.dynamics.effects import DEEP, METHOD, Parts, Scheme
from flexclear.pipeline.dynamics.kernels import INTERPRETED

#: of each function in words, and where the header keeps its address, if others call it; of straight code that depends
#: on the rows solved for. In this order this process compiles, in the opposite one the second, so that they meet in the
#: middle; what replaces straight code has most kernels in common, which each process compiles once
FUNCTIONS: dict[str, tuple[str, int | None]] = {
    "advance": ("integrator", None),
    "prescribe": ("laws of time", m.PRESCRIBE),
    "project": ("closing of the loops", m.PROJECT),
    "retract": ("retractions", m.RETRACT),
    "observe": ("recorded quantities", None),
    "evaluate": ("equations of motion", m.EVALUATE),
    "describe": ("recorded quantities", m.DESCRIBE),
    DESCRIBED: ("recorded quantities of this mechanism alone", None),
    WHOLE: ("equations of motion of this mechanism alone", None),
    SPECIALISED: ("equations of motion of this mechanism alone", None),
    "resolve": ("integrator's events", m.RESOLVE),
}
#: what is called first when a run has come to its end: without waiting where the second process is at it
LATE = "observe"
_FLOATS, _TABLE = np.zeros(0), np.zeros((0, 0))
_TYPES = {"I": ctypes.c_void_p, "F": ctypes.c_void_p, "i": ctypes.c_int64, "f": ctypes.c_double}


@cache
def prototype(name: str) -> Any:
    """The C function type of a compiled function, which Python calls."""
    return ctypes.CFUNCTYPE(ctypes.c_int64, *(_TYPES[kind] for kind in SIGNATURES[name] if kind != " "))


def place(array: np.ndarray, kind: type = np.float64) -> Any:
    """Where the entries of an array are, as C functions take it; TypeError for one that is not as they read it."""
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"an array of {array.dtype}, {array.strides} bytes apart, instead of {kind.__name__} in a row")
    return array if INTERPRETED else array.ctypes.data


@dataclass(frozen=True)
class Entry:
    """The compiled functions of a mechanism, by their addresses; h must have been given those.

    Calls let other threads run.

    late: where `LATE` is, when it is there.
    """

    addresses: Mapping[str, int]
    late: Late

    def connect(self, h: np.ndarray) -> None:
        """Write into the header where this process has put the functions that others call."""
        for name, (_, where) in FUNCTIONS.items():
            if where is not None:
                h[where] = self.addresses.get(name, 0)

    def evaluate(self, h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, t: float, repeat: int = 1) -> None:
        """Slope of the state in Y at time t, into the first row of SLOPES."""
        self._function("advance")(*_tables(h, f, w, n), t, repeat, *_record(_FLOATS, _TABLE, _TABLE))

    def advance(
        self,
        h: np.ndarray,
        f: np.ndarray,
        w: np.ndarray,
        n: np.ndarray,
        outputs: np.ndarray,
        rows: np.ndarray,
        events: np.ndarray,
        by: Callable[[int, list[int]], None] | None = None,
    ) -> None:
        """Step to the end of the segment or of the budget.

        by: what is to call the compiled function, given its address, and a word for each of its arguments but t and
        repeat.
        """
        tables, record = _tables(h, f, w, n), _record(outputs, rows, events)
        if by is None:
            self._function("advance")(*tables, 0, -1, *record)
        else:
            by(self.addresses["advance"], [*tables, *record])

    def observe(
        self,
        h: np.ndarray,
        f: np.ndarray,
        w: np.ndarray,
        n: np.ndarray,
        rows: np.ndarray,
        pieces: np.ndarray,
        tolerance: float,
        out: np.ndarray,
    ) -> None:
        """Evaluate what is recorded of every row."""
        given = (place(rows), *rows.shape, place(pieces, np.int64), *pieces.shape)
        self._function(LATE)(*_tables(h, f, w, n), *given, tolerance, place(out), len(out))

    def complete(self) -> None:
        """Wait for what is still being compiled."""
        self.late.address()

    @cached_property
    def _known(self) -> dict[str, Callable]:
        return {}

    def _function(self, name: str) -> Callable:
        function = self._known.get(name)
        if function is None:
            address = self.late.address() if name == LATE else self.addresses[name]
            function = self._known[name] = interpreted[address] if INTERPRETED else prototype(name)(address)
        return function


def _tables(h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray) -> tuple:
    return place(h, np.int64), place(f), place(w), place(n, np.int64)


def _record(outputs: np.ndarray, rows: np.ndarray, events: np.ndarray) -> tuple:
    return place(outputs), len(outputs), place(rows), *rows.shape, place(events), *events.shape


class Late:
    """A function that may still be in the making, in a process that ends with this one."""

    def __init__(self, path: Path, bring_it: Callable[[], None], helpers: ExitStack) -> None:
        self._path, self._bring, self._making = path, bring_it, Lock()
        self._end = finalize(self, helpers.close)

    def address(self) -> int:
        """Where it is, once it is there."""
        with self._making:  # members of ensembles run side by side
            if self._end.alive:
                self._bring()
                self._end()
        return loaded[self._path.stem].address


def entry(
    parts: Parts, scheme: Scheme, tell: Callable[[str], None], equations: Mapping[str, str] = MappingProxyType({})
) -> Entry:
    """The compiled functions for these parts; `tell` receives what has to be compiled.

    equations: sources by name of straight code, or of kernels; these are compiled instead where there is none.
    """
    meet(METHOD.format(scheme.integrator))
    if parts.articulated:
        meet(DEEP)
    folder, began = writable(kernel_root(), tell), time.monotonic()
    texts = {**sources.sources(parts, scheme), **equations}
    files = {name: _file(folder, name, source) for name, source in texts.items()}
    with ExitStack() as helpers:
        late = files[LATE]

        def bring_late() -> None:
            with ExitStack() as more:
                _bring(folder, {LATE: late}, tell, began, more)

        _bring(folder, files, tell, began, helpers, {late})
        if not all(loaded[files[name].stem].address for name in (WHOLE, DESCRIBED) if name in files):
            kernels = {name: _file(folder, name, source) for name, source in sources.kernels(parts).items()}
            _bring(folder, kernels, tell, began, helpers)
            files |= kernels
        left = Late(late, bring_late, helpers.pop_all())
    return Entry({name: loaded[path.stem].address for name, path in files.items() if path != late}, left)


def straight(name: str, source: str, tell: Callable[[str], None]) -> int:
    """Address of code for one wiring, whose name and source are of `sources`; 0 when there is none, UnsuitedError when
    there is none of several lanes or with changes."""
    folder, began = writable(kernel_root(), tell), time.monotonic()
    path = _file(folder, name, source)
    with ExitStack() as helpers:
        _bring(folder, {name: path}, tell, began, helpers)
    return loaded[path.stem].address


def _bring(
    folder: Path,
    files: Mapping[str, Path],
    tell: Callable[[str], None],
    began: float,
    helpers: ExitStack,
    late: Collection[Path] = (),
) -> None:
    """Load files by the names of their functions, from disk or compiled there.

    helpers: gets the second process, where there is one.  late: files of which that may still be at work.
    """
    names = {path: name for name, path in files.items() if path.stem not in loaded}
    requested = sorted(names, key=lambda path: [*FUNCTIONS].index(names[path]))
    with disk_limits(folder):
        missing = [path for path in requested if not compiled(path)]
        helpers.enter_context(second_process(missing[::-1]))
        bring(requested, lambda path: _announce(tell, FUNCTIONS[names[path]][0], began), late)
        if missing:
            prune(folder)


def _announce(tell: Callable[[str], None], what: str, began: float) -> None:
    seconds = time.monotonic() - began
    so_far = f", {seconds:.0f} s so far" if seconds >= 1.0 else ""
    tell(f"compiling for this kind of mechanism (once; later runs fetch it from disk): {what}{so_far}")


def _file(folder: Path, name: str, source: str) -> Path:
    """The generated file, there with exactly this text."""
    path = folder / f"flexclear_{name}_{digest(source)}.py"
    try:
        same = path.read_bytes() == source.encode()
    except OSError:
        same = False
    if not same:
        publish(path, source.encode())
    return path


@cache
def digest(source: str) -> str:
    """Digest of a generated source, of the kernel sources that it reaches, and of the compiler."""
    total = hashlib.sha256(source.encode())
    total.update(f"{library_version('numba')} {library_version('llvmlite')} {sys.version_info[:2]}".encode())
    for name, source_digest in sorted(reach.reached(source).items()):
        total.update(f"{name} {source_digest}".encode())
    return total.hexdigest()[:20]
