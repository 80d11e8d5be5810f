"""Compiled functions of a mechanism, cached on disk across processes.

Each is a generated file (`sources`) whose name is a digest of its text, of the code of all kernels and of the
compiler's versions. The functions call each other by address (`calls`), so that mechanisms share them.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from flexclear.artifacts.disk import disk_limits, publish
from flexclear.artifacts.paths import kernel_root
from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import machine_code, sources
from flexclear.dynamics.compile.compiler_process import second_process
from flexclear.dynamics.compile.files import CODE, SIGNATURES, is_compiled, load_files, loaded
from flexclear.dynamics.compile.folder import prune, writable
from flexclear.dynamics.compile.sources import SPECIALISED
from flexclear.dynamics.effects import Parts, Scheme
from flexclear.workflow.fingerprint import TREE, library_version, sources_of

#: of each function: description for progress, and the header's index of its address if others call it (specialised code
#: has one per selection of closure rows). This process compiles in this order, the second one in the opposite order
FUNCTIONS: dict[str, tuple[str, int | None]] = {
    "advance": ("integrator", None),
    "prescribe": ("laws of time", m.PRESCRIBE),
    "project": ("projection onto loop closures", m.PROJECT),
    "observe": ("outputs", None),
    SPECIALISED: ("specialised equations of motion", None),
    "resolve": ("location of events", m.RESOLVE),
}
#: what of `dynamics` no generated file imports
NO_KERNELS = {"analyses", "events", "linear", "mechanics", "model", "plan", "record", "routines", "run"}
NO_KERNELS |= {"sensitivity", "starts"}
#: h, f, w and n
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
#: without steps: no output times, no rows, no events
NO_RECORD = np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))
_TYPES = {"I": ctypes.c_void_p, "F": ctypes.c_void_p, "i": ctypes.c_int64, "f": ctypes.c_double}


@cache
def function(name: str, address: int) -> Callable:
    """Return the compiled function at an address for calls from Python; calls let other threads run."""
    types = (_TYPES[kind] for kind in SIGNATURES[name] if kind != " ")
    made: Callable = ctypes.CFUNCTYPE(ctypes.c_int64, *types)(address)
    return made


def address(array: np.ndarray, kind: type = np.float64) -> int:
    """Return the address of an array's entries for C functions; raise TypeError for another type or memory layout."""
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"an array of {array.dtype}, {array.strides} bytes apart, instead of {kind.__name__} in a row")
    return array.ctypes.data


def addresses_of_arrays(arrays: Arrays) -> tuple[int, ...]:
    """Return the addresses of h, f, w and n."""
    h, f, w, n = arrays
    return address(h, np.int64), address(f), address(w), address(n, np.int64)


def record(outputs: np.ndarray, rows: np.ndarray, events: np.ndarray) -> tuple[int, ...]:
    """Return the arguments of `advance` for output times, rows of the record and events."""
    return address(outputs), len(outputs), address(rows), *rows.shape, address(events), *events.shape


@dataclass(frozen=True)
class Entry:
    """Compiled functions of a mechanism, by their addresses, which `connect` must have written into h."""

    addresses: Mapping[str, int]

    compiled: ClassVar[bool] = True

    def connect(self, h: np.ndarray) -> None:
        """Write into the header the addresses of the functions that other compiled functions call."""
        for name, (_, where) in FUNCTIONS.items():
            if where is not None:
                h[where] = self.addresses.get(name, 0)

    def observe(self, arrays: Arrays, rows: np.ndarray, pieces: np.ndarray, tolerance: float, out: np.ndarray) -> None:
        """Evaluate the outputs of every row; arrays: h, f, w and n."""
        laws = address(pieces, np.int64), *pieces.shape
        given = address(rows), *rows.shape, *laws, tolerance, address(out), len(out)
        function("observe", self.addresses["observe"])(*addresses_of_arrays(arrays), *given)

    def advance(self, arrays: Arrays, outputs: np.ndarray, rows: np.ndarray, events: np.ndarray) -> None:
        """Step to the end of the segment or of the budget."""
        function("advance", self.addresses["advance"])(
            *addresses_of_arrays(arrays), 0, -1, *record(outputs, rows, events)
        )

    def evaluate(self, arrays: Arrays, t: float, repeat: int) -> None:
        """Evaluate the state in Y at time t, so many times."""
        function("advance", self.addresses["advance"])(*addresses_of_arrays(arrays), t, repeat, *record(*NO_RECORD))

    def evaluate_laws(self, arrays: Arrays, t: float) -> None:
        """Evaluate all laws at time t."""
        function("prescribe", self.addresses["prescribe"])(*addresses_of_arrays(arrays), t)


def entry(parts: Parts, scheme: Scheme, report: Callable[[str], None]) -> Entry:
    """Return the compiled functions for these parts; `report` receives a message for each function to compile."""
    folder, began = writable(kernel_root(), report), time.monotonic()
    files = {name: _file(folder, name, source) for name, source in sources.sources_of_functions(parts, scheme).items()}
    _load(folder, files, report, began)
    return Entry({name: loaded[path.stem].address for name, path in files.items()})


def address_of_specialised(name: str, source: str, report: Callable[[str], None]) -> int:
    """Return the address of specialised code for one topology; name and source: of `sources`; 0 when LLVM yields none.

    Raises UnsuitedError when code for several lanes, or with tangents, is impossible.
    """
    folder, began = writable(kernel_root(), report), time.monotonic()
    path = _file(folder, name, source)
    _load(folder, {name: path}, report, began)
    return loaded[path.stem].address


def addresses_of_texts(texts: Mapping[str, Callable[[], str]], report: Callable[[str], None]) -> dict[str, int]:
    """Return the addresses of functions given by LLVM code, by names that tell all that the code depends on.

    Each is called `routine` in its text, and stored in a file of its own, without a source.
    """
    paths, compiling = _routines(texts, report), False
    folder = writable(kernel_root(), report)
    with disk_limits(folder):
        for name, path in paths.items():
            if path.stem not in loaded and not _loads(path):
                if not compiling:
                    compiling = True
                    report("compiling routines (first run of a mechanism of this kind only)")
                image = machine_code.image_of_module(
                    "routine", *machine_code.assemble(texts[name](), 2, optimised=False)
                )
                publish(path, image)
                loaded.setdefault(path.stem, machine_code.load(image))
        if compiling:
            prune(folder)
    return {name: loaded[path.stem].address for name, path in paths.items()}


def stored_codes(names: Iterable[str]) -> dict[str, int] | None:
    """Return the addresses of functions of `addresses_of_texts` by their names; None when one is not on disk."""
    paths = _routines(names, lambda _: None)
    if not all(path.stem in loaded or _loads(path) for path in paths.values()):
        return None
    return {name: loaded[path.stem].address for name, path in paths.items()}


def _routines(names: Iterable[str], report: Callable[[str], None]) -> dict[str, Path]:
    folder = writable(kernel_root(), report)
    return {name: folder / f"flexclear_routine_{name}{CODE}" for name in names}


def _loads(path: Path) -> bool:
    """Load the code of a routine; return False when it is missing or damaged."""
    try:
        loaded.setdefault(path.stem, machine_code.load(path.read_bytes()))
        os.utime(path)  # marks it as used, against pruning
    except (OSError, ValueError, KeyError):
        return False
    return True


def _load(folder: Path, files: Mapping[str, Path], report: Callable[[str], None], began: float) -> None:
    """Load the functions of files, from disk or after compiling them; files: by function name."""
    names = {path: name for name, path in files.items() if path.stem not in loaded}
    requested = sorted(names, key=lambda path: [*FUNCTIONS].index(names[path]))
    with disk_limits(folder):
        missing = [path for path in requested if not is_compiled(path)]
        with second_process(missing[::-1]):
            load_files(requested, lambda path: _announce(report, FUNCTIONS[names[path]][0], began))
        if missing:
            prune(folder)


def _announce(report: Callable[[str], None], what: str, began: float) -> None:
    seconds = time.monotonic() - began
    so_far = f", {seconds:.0f} s so far" if seconds >= 1.0 else ""
    report(f"compiling {what} (first run of a mechanism of this kind only){so_far}")


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
    """Return the digest of a generated source, of the code of all kernels, and of the compiler."""
    return hashlib.sha256(f"{source}{_kernels()}".encode()).hexdigest()[:20]


@cache
def _kernels() -> str:
    """Return digests and versions of all that compiled code depends on besides its generated source."""
    known = sources_of(TREE, kernel_root() / "code.json")
    code = known.digest("flexclear.dynamics", NO_KERNELS), known.digest("flexclear.scene.event_kinds")
    return f"{code} {library_version('numba')} {library_version('llvmlite')} {sys.version_info[:2]}"
