"""Machine code of routines on disk: by content, processor and release of the compiler; and lists ready to run.

A routine is traced in each process, and its tape decides whether the code on disk is its own; so one that is used by
several mechanisms is compiled once for all of them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from flexclear.dynamics.compile import functions
from flexclear.dynamics.routines.calls import CallList
from flexclear.dynamics.routines.emission import interpreter_text, routine_text
from flexclear.workflow.fingerprint import TREE, library_version, sources_of

#: modules whose text decides the code of a tape
EMITTING = ("flexclear.dynamics.routines.emission", "flexclear.dynamics.specialise.code")


@dataclass(frozen=True, eq=False)
class LoadedList:
    """A list of calls as the interpreter reads it.

    interpreter: its address.  codes: address per call.  offsets: of the runs of all calls.  begins: per call, the index
    of its first one.  size: number of results.
    """

    interpreter: int
    codes: np.ndarray
    offsets: np.ndarray
    begins: np.ndarray
    size: int

    def instance(self) -> ListInstance:
        """Return the list with results of its own."""
        return ListInstance(self)


class ListInstance:
    """A list of calls with its results, for one engine. words: what the interpreter reads (`routines.emission`)."""

    def __init__(self, loaded: LoadedList) -> None:
        self.loaded, self.results = loaded, np.zeros(loaded.size)
        self._starts = (loaded.offsets.ctypes.data + loaded.offsets.itemsize * loaded.begins).astype(np.int64)
        tables = (loaded.codes, self._starts, self.results)
        self.words = np.array([len(loaded.codes), *(table.ctypes.data for table in tables)], dtype=np.int64)


def load(calls: CallList, report: Callable[[str], None]) -> LoadedList:
    """Return a list ready to run; `report` receives a message before routines are compiled."""
    names = {id(code): _name(code.digest) for code in calls.codes}
    texts = {names[id(code)]: partial(routine_text, code) for code in calls.codes}
    first = _name("interpreter")
    at = functions.assembled({first: interpreter_text, **texts}, report)
    lengths = [len(call.offsets) for call in calls.calls]
    return LoadedList(
        at[first],
        np.array([at[names[id(call.code)]] for call in calls.calls], dtype=np.int64),
        np.array([offset for call in calls.calls for offset in call.offsets], dtype=np.int32),
        np.cumsum([0, *lengths])[:-1],
        calls.size,
    )


def _name(content: str) -> str:
    return hashlib.sha256(f"{_compiler()} {content}".encode()).hexdigest()[:20]


@cache
def _compiler() -> str:
    """Return what decides the code of a tape besides the tape: releases, and the modules that write it."""
    sources = sources_of(TREE)
    written = [getattr(sources.module(name), "digest", "") for name in EMITTING]
    return " ".join([library_version("llvmlite"), *written])
