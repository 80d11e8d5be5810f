"""Compiled functions of a mechanism, cached on disk across processes.

Each is a generated file (`sources`) whose name is a digest of the sources of all kernels that it can reach and of the
compiler's versions. The functions call each other by address (`calls`), so that mechanisms share them.
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

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

#: of each function: description for progress, and the header's index of its address if others call it (specialised code
#: has one per selection of closure rows). This process compiles in this order, the second one in the opposite order;
#: the generic kernels that replace specialised code have most code in common, which each process compiles once
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
_FLOATS, _TABLE = np.zeros(0), np.zeros((0, 0))
_TYPES = {"I": ctypes.c_void_p, "F": ctypes.c_void_p, "i": ctypes.c_int64, "f": ctypes.c_double}


@cache
def function(name: str, address: int) -> Callable:
    """Return the compiled function at an address for calls from Python; calls let other threads run."""
    if INTERPRETED:
        return interpreted[address]
    types = (_TYPES[kind] for kind in SIGNATURES[name] if kind != " ")
    made: Callable = ctypes.CFUNCTYPE(ctypes.c_int64, *types)(address)
    return made


def place(array: np.ndarray, kind: type = np.float64) -> Any:
    """Return the address of an array's entries for C functions; raise TypeError for another type or memory layout."""
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"an array of {array.dtype}, {array.strides} bytes apart, instead of {kind.__name__} in a row")
    return array if INTERPRETED else array.ctypes.data


@dataclass(frozen=True)
class Entry:
    """Compiled functions of a mechanism, by their addresses, which `connect` must have written into h."""

    addresses: Mapping[str, int]

    def connect(self, h: np.ndarray) -> None:
        """Write into the header the addresses of the functions that other compiled functions call."""
        for name, (_, where) in FUNCTIONS.items():
            if where is not None:
                h[where] = self.addresses.get(name, 0)

    def evaluate(self, h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, t: float, repeat: int = 1) -> None:
        """Store the rate of the state in Y at time t in the first row of SLOPES; repeat: number of evaluations."""
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

        by: calls the compiled function instead, given its address and one word per argument except t and repeat.
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
        """Evaluate the recorded quantities of every row."""
        given = (place(rows), *rows.shape, place(pieces, np.int64), *pieces.shape)
        self._function("observe")(*_tables(h, f, w, n), *given, tolerance, place(out), len(out))

    def _function(self, name: str) -> Callable:
        return function(name, self.addresses[name])


def _tables(h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray) -> tuple:
    return place(h, np.int64), place(f), place(w), place(n, np.int64)


def _record(outputs: np.ndarray, rows: np.ndarray, events: np.ndarray) -> tuple:
    return place(outputs), len(outputs), place(rows), *rows.shape, place(events), *events.shape


def entry(
    parts: Parts, scheme: Scheme, tell: Callable[[str], None], equations: Mapping[str, str] = MappingProxyType({})
) -> Entry:
    """Return the compiled functions for these parts; `tell` receives a message for each function to compile.

    equations: sources by name of specialised code, or of generic kernels, which are compiled where the former has none.
    """
    meet(METHOD.format(scheme.integrator))
    if parts.articulated:
        meet(DEEP)
    folder, began = writable(kernel_root(), tell), time.monotonic()
    texts = {**sources.sources(parts, scheme), **equations}
    files = {name: _file(folder, name, source) for name, source in texts.items()}
    _bring(folder, files, tell, began)
    if not all(loaded[files[name].stem].address for name in (WHOLE, DESCRIBED) if name in files):
        kernels = {name: _file(folder, name, source) for name, source in sources.kernels(parts).items()}
        _bring(folder, kernels, tell, began)
        files |= kernels
    return Entry({name: loaded[path.stem].address for name, path in files.items()})


def straight(name: str, source: str, tell: Callable[[str], None]) -> int:
    """Return the address of specialised code for one topology; name and source: of `sources`; 0 when LLVM yields none.

    Raises UnsuitedError when code for several lanes, or with tangents, is impossible.
    """
    folder, began = writable(kernel_root(), tell), time.monotonic()
    path = _file(folder, name, source)
    _bring(folder, {name: path}, tell, began)
    return loaded[path.stem].address


def _bring(folder: Path, files: Mapping[str, Path], tell: Callable[[str], None], began: float) -> None:
    """Load the functions of files, from disk or after compiling them; files: by function name."""
    names = {path: name for name, path in files.items() if path.stem not in loaded}
    requested = sorted(names, key=lambda path: [*FUNCTIONS].index(names[path]))
    with disk_limits(folder):
        missing = [path for path in requested if not compiled(path)]
        with second_process(missing[::-1]):
            bring(requested, lambda path: _announce(tell, FUNCTIONS[names[path]][0], began))
        if missing:
            prune(folder)


def _announce(tell: Callable[[str], None], what: str, began: float) -> None:
    seconds = time.monotonic() - began
    so_far = f", {seconds:.0f} s so far" if seconds >= 1.0 else ""
    tell(f"compiling for this kind of mechanism (once; later runs fetch it from disk): {what}{so_far}")


def _file(folder: Path, name: str, source: str) -> Path:
    """Return the path of the generated file, written unless it exists with exactly this text."""
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
    """Return the digest of a generated source, of the kernel sources that it reaches, and of the compiler."""
    total = hashlib.sha256(source.encode())
    total.update(f"{library_version('numba')} {library_version('llvmlite')} {sys.version_info[:2]}".encode())
    for name, source_digest in sorted(reach.reached(source).items()):
        total.update(f"{name} {source_digest}".encode())
    return total.hexdigest()[:20]
