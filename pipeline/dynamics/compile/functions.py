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
_TYPES = {"I": ctypes.c_void_p, "F": ctypes.c_void_p, "i": ctypes.c_int64, "f": ctypes.c_double}


@cache
def function(name: str, address: int) -> Callable:
    """A compiled function that Python calls, by its name and where it is; calls let other threads run."""
    if INTERPRETED:
        return interpreted[address]
    types = (_TYPES[kind] for kind in SIGNATURES[name] if kind != " ")
    made: Callable = ctypes.CFUNCTYPE(ctypes.c_int64, *types)(address)
    return made


def place(array: np.ndarray, kind: type = np.float64) -> Any:
    """Where the entries of an array are, as C functions take it; TypeError for one that is not as they read it."""
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"an array of {array.dtype}, {array.strides} bytes apart, instead of {kind.__name__} in a row")
    return array if INTERPRETED else array.ctypes.data


@dataclass(frozen=True)
class Entry:
    """The compiled functions of a mechanism, by their addresses."""

    addresses: Mapping[str, int]

    def connect(self, h: np.ndarray) -> None:
        """Write into the header where this process has put the functions that others call."""
        for name, (_, where) in FUNCTIONS.items():
            if where is not None:
                h[where] = self.addresses.get(name, 0)


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
    _bring(folder, files, tell, began)
    if not all(loaded[files[name].stem].address for name in (WHOLE, DESCRIBED) if name in files):
        kernels = {name: _file(folder, name, source) for name, source in sources.kernels(parts).items()}
        _bring(folder, kernels, tell, began)
        files |= kernels
    return Entry({name: loaded[path.stem].address for name, path in files.items()})


def straight(name: str, source: str, tell: Callable[[str], None]) -> int:
    """Address of code for one wiring, whose name and source are of `sources`; 0 when there is none, UnsuitedError when
    there is none of several lanes or with changes."""
    folder, began = writable(kernel_root(), tell), time.monotonic()
    path = _file(folder, name, source)
    _bring(folder, {name: path}, tell, began)
    return loaded[path.stem].address


def _bring(folder: Path, files: Mapping[str, Path], tell: Callable[[str], None], began: float) -> None:
    """Load files by the names of their functions, from disk or compiled there."""
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
