"""The compiled functions of a mechanism, cached on disk across processes.

Each is a generated file (`sources`) whose name is a digest of the sources of all kernels it can
reach and of the versions of the compiler, because Numba's own cache looks at that file alone and
would keep stale callees. The functions call each other by address (`calls`), so that mechanisms
share those which are alike.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import itertools
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import ModuleType

import llvmlite
import numba
import numpy as np
from numba.core.bytecode import FunctionIdentity

from pipeline.core.artifacts.paths import kernel_root
from pipeline.core.workflow.fingerprint import Sources, imported
from pipeline.dynamics.assembly.numbers import Kinds
from pipeline.dynamics.assembly.sources import sources
from pipeline.dynamics.integrate.method import Scheme
from pipeline.dynamics.tables import ADDRESSES, place

SOURCES = Sources(Path(__file__).resolve().parents[3])
#: what the functions are to who waits for them
WORDS = {
    "evaluate": "equations of motion",
    "project": "closing of the loops",
    "displace": "displacements",
    "observe": "recorded quantities",
    "advance": "integrator",
}
_FLOATS, _TABLE = np.zeros(0), np.zeros((0, 0))


@dataclass(frozen=True)
class Entry:
    """The compiled functions of a mechanism; h must have been given their addresses."""

    modules: dict[str, ModuleType]

    def connect(self, h: np.ndarray) -> None:
        """Write into the header where this process has put the functions that others call."""
        for name in ADDRESSES:
            module = self.modules.get(name.lower())
            h[place(name)] = getattr(module, name.lower()).address if module else 0

    def evaluate(self, h: np.ndarray, f: np.ndarray, w: np.ndarray, n: np.ndarray, t: float, repeat: int = 1) -> None:
        """Slope of the state in Y at time t, into the first row of SLOPES."""
        self.modules["advance"].advance(h, f, w, n, t, repeat, _FLOATS, _TABLE, _TABLE)

    def advance(
        self,
        h: np.ndarray,
        f: np.ndarray,
        w: np.ndarray,
        n: np.ndarray,
        outputs: np.ndarray,
        rows: np.ndarray,
        events: np.ndarray,
    ) -> None:
        """Step to the end of the segment or of the budget."""
        self.modules["advance"].advance(h, f, w, n, 0.0, -1, outputs, rows, events)

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
        self.modules["observe"].observe(h, f, w, n, rows, pieces, tolerance, out)


def entry(kinds: Kinds, scheme: Scheme, tell: Callable[[str], None]) -> Entry:
    """The compiled functions for these kinds; `tell` hears of what has to be compiled."""
    began, modules = time.monotonic(), {}
    for name, source in sources(kinds, scheme).items():
        full = f"flexclear_{name}_{digest(source)}"
        if full not in sys.modules:
            _fetch(full, source, partial(_announce, tell, WORDS[name], began))
        modules[name] = sys.modules[full]
    return Entry(modules)


def _announce(tell: Callable[[str], None], what: str, began: float) -> None:
    seconds = time.monotonic() - began
    so_far = f", {seconds:.0f} s so far" if seconds >= 1.0 else ""
    tell(f"compiling for this kind of mechanism (once; later runs fetch it from disk): {what}{so_far}")


def _fetch(name: str, source: str, tell: Callable[[], None]) -> None:
    """Import a generated file; its function is compiled as that is done, or fetched from disk."""
    path = _folder() / f"{name}.py"
    if not path.exists():
        _write(path, source)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)  # what is on disk refers to it
    compiled = any((path.parent / "__pycache__").glob(f"{name}.*.nbc"))
    if not compiled:
        tell()
    _number_apart()
    try:
        with nullcontext() if compiled else _alone(path):
            spec.loader.exec_module(module)
    except BaseException:  # interrupted, or no room on the disk: not to be taken for whole later
        del sys.modules[name]
        raise


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Held while a file may be compiled: of two processes the second waits for the first's code."""
    with path.with_suffix(".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _number_apart() -> None:
    """Let Numba's names be those of no other process.

    It names the code of a function by its qualified name and a counter of the process. Files that
    two processes compiled would share names for different code, and a third process that loads
    both would mix them up (numba issue 10486); so the counter starts anywhere.
    """
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6), "big") << 16)


def _folder() -> Path:
    folder = kernel_root()
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _write(path: Path, source: str) -> None:
    temporary = path.with_suffix(f".{os.getpid()}.tmp")
    temporary.write_text(source)
    os.replace(temporary, path)


@cache
def digest(source: str) -> str:
    """Digest of a generated source, of the kernel sources that it reaches, and of the compiler."""
    total = hashlib.sha256(source.encode())
    total.update(f"{numba.__version__} {llvmlite.__version__} {sys.version_info[:2]}".encode())
    for name, source_digest in sorted(reached(source).items()):
        total.update(f"{name} {source_digest}".encode())
    return total.hexdigest()[:20]


def reached(source: str) -> dict[str, str]:
    """Digests of this tower's modules that a generated source imports, directly or not.

    Packages on the way do not count: their ``__init__`` modules hold no kernel, but reach everything.
    """
    found: dict[str, str] = {}
    waiting = sorted(imported(source.encode(), "entry", package=False)[0])
    while waiting:
        name = waiting.pop()
        module = SOURCES.module(name)
        package = (SOURCES.root / Path(*name.split("."))).is_dir()
        if module is None or name in found or not name.startswith("pipeline.dynamics"):
            continue
        if not package:
            found[name] = module.digest
            waiting.extend(module.own)
    return found
