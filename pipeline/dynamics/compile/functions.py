"""The compiled functions of a mechanism, cached on disk across processes.

Each is a generated file (`sources`) whose name is a digest of the sources of all kernels it can
reach and of the versions of the compiler. The functions call each other by address (`calls`), so
that mechanisms share those which are alike.
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from flexclear.pipeline.core.artifacts.disk import disk_limits, publish
from flexclear.pipeline.core.artifacts.paths import kernel_root
from flexclear.pipeline.core.workflow.fingerprint import TREE, Sources, imported, library_version
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import sources
from flexclear.pipeline.dynamics.compile.compiler_process import second_process
from flexclear.pipeline.dynamics.compile.files import bring, compiled, interpreted, loaded
from flexclear.pipeline.dynamics.compile.folder import prune, writable
from flexclear.pipeline.dynamics.effects import Parts, Scheme
from flexclear.pipeline.dynamics.kernels import INTERPRETED
from flexclear.pipeline.dynamics.specialise.wiring import Wiring

SOURCES = Sources(TREE)
#: what the functions are to who waits for them
WORDS = {
    "evaluate": "equations of motion",
    "project": "closing of the loops",
    "retract": "retractions",
    "observe": "recorded quantities",
    "advance": "integrator",
    "specialised": "equations of motion of this mechanism alone",
}
SPECIALISED = "specialised"
#: what others call, and where the header keeps its address
ADDRESSES = {"evaluate": m.EVALUATE, "project": m.PROJECT, "retract": m.RETRACT}
#: in this order this process compiles, and in the opposite one the second, so that they meet in the middle; the last
#: two have most kernels in common, which each process compiles once
ORDER = ("advance", "project", "retract", "observe", "evaluate", SPECIALISED)
#: where the code of kernels stands, and what they number by
CODE = ("flexclear.pipeline.dynamics", "flexclear.pipeline.core.artifacts.event_kinds")
_FLOATS, _TABLE = np.zeros(0), np.zeros((0, 0))
_PLACE, _INTEGER, _FLOAT = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_TABLES, _TABLE_AT = (_PLACE,) * 4, (_PLACE, _INTEGER, _INTEGER)
#: C types of what Python calls, as `calls.SIGNATURES` has them
PROTOTYPES = {
    "observe": ctypes.CFUNCTYPE(_INTEGER, *_TABLES, *_TABLE_AT, *_TABLE_AT, _FLOAT, *_TABLE_AT),
    "advance": ctypes.CFUNCTYPE(_INTEGER, *_TABLES, _FLOAT, _INTEGER, _PLACE, _INTEGER, *_TABLE_AT, *_TABLE_AT),
}
LANES = ctypes.CFUNCTYPE(_INTEGER, _PLACE, _PLACE, _PLACE, _INTEGER)


def place(array: np.ndarray, kind: type = np.float64) -> Any:
    """Where the entries of an array are, as C functions take it; TypeError for one that is not as they read it."""
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"an array of {array.dtype}, {array.strides} bytes apart, instead of {kind.__name__} in a row")
    return array if INTERPRETED else array.ctypes.data


@dataclass(frozen=True)
class Entry:
    """The compiled functions of a mechanism, by their addresses; h must have been given those.

    Calls let other threads run.
    """

    addresses: Mapping[str, int]

    def connect(self, h: np.ndarray) -> None:
        """Write into the header where this process has put the functions that others call."""
        for name, where in ADDRESSES.items():
            h[where] = self.addresses.get(name, 0)
        h[m.RATES] = h[m.EVALUATE]

    def evaluate(self, h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, t: float, repeat: int = 1) -> None:
        """Slope of the state in Y at time t, into the first row of SLOPES."""
        self._advance(_tables(h, f, w, n), t, repeat, _FLOATS, _TABLE, _TABLE)

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

        by: what is to call the compiled function, given its address and a word for each of its arguments.
        """
        self._advance(_tables(h, f, w, n), 0, -1, outputs, rows, events, by)

    def _advance(
        self,
        tables: tuple,
        t: float,
        repeat: int,
        outputs: np.ndarray,
        rows: np.ndarray,
        events: np.ndarray,
        by: Callable[[int, list[int]], None] | None = None,
    ) -> None:
        record = [place(outputs), len(outputs), place(rows), *rows.shape, place(events), *events.shape]
        if by is None:
            self._functions["advance"](*tables, t, repeat, *record)
        else:
            by(self.addresses["advance"], [*tables, 0, repeat, *record])  # steps have their time in w

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
        self._functions["observe"](*_tables(h, f, w, n), *given, tolerance, place(out), *out.shape)

    @cached_property
    def _functions(self) -> dict[str, Callable]:
        if INTERPRETED:
            return {name: interpreted[self.addresses[name]] for name in PROTOTYPES}
        return {name: prototype(self.addresses[name]) for name, prototype in PROTOTYPES.items()}


def _tables(h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray) -> tuple:
    return place(h, np.int64), place(f), place(w), place(n, np.int64)


def entry(parts: Parts, scheme: Scheme, tell: Callable[[str], None]) -> Entry:
    """The compiled functions for these parts; `tell` hears of what has to be compiled."""
    folder, began = writable(kernel_root(), tell), time.monotonic()
    with disk_limits(folder):
        return Entry(_addresses(folder, sources.sources(parts, scheme), tell, began))


def specialised(parts: Parts, wiring: Wiring, tell: Callable[[str], None], lanes: int = 0) -> int:
    """Address of the right-hand side for one wiring; UnsuitedError when there is none.

    lanes: see `sources.specialised`; of several that of what lets as many steppers run (`compile.lanes`).
    """
    folder, began = writable(kernel_root(), tell), time.monotonic()
    with disk_limits(folder):
        found = _addresses(folder, {SPECIALISED: sources.specialised(parts, wiring, lanes)}, tell, began)
    return found[SPECIALISED]


def _addresses(folder: Path, texts: dict[str, str], tell: Callable[[str], None], began: float) -> dict[str, int]:
    """Where the function of each source is, by its name, fetched from the folder or compiled into it."""
    files = {name: _file(folder, name, source) for name, source in texts.items()}
    names = {path: name for name, path in files.items() if path.stem not in loaded}
    wanted = sorted(names, key=lambda path: ORDER.index(names[path]))
    missing = [path for path in wanted if not compiled(path)]
    with second_process(missing[::-1]):
        bring(wanted, lambda path: _announce(tell, WORDS[names[path]], began))
    if missing:
        prune(folder)
    return {name: loaded[path.stem].address for name, path in files.items()}


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
    for name, source_digest in sorted(reached(source).items()):
        total.update(f"{name} {source_digest}".encode())
    return total.hexdigest()[:20]


def reached(source: str) -> dict[str, str]:
    """Digests of the modules with `CODE` that a generated source imports, directly or not.

    Packages on the way do not count: their ``__init__`` modules hold no kernel, but reach everything.
    """
    found: dict[str, str] = {}
    waiting = sorted(imported(source.encode(), "entry", package=False)[0])
    while waiting:
        name = waiting.pop()
        module = SOURCES.module(name)
        package = (SOURCES.root / Path(*name.split("."))).is_dir()
        if module is None or name in found or not name.startswith(CODE):
            continue
        if not package:
            found[name] = module.digest
            waiting.extend(module.own)
    return found
