"""Routines and lists of their calls on disk, and lists ready to run.

Code of a routine is stored by its content: a tape that another mechanism has as well is compiled once for both. A list
is stored by the topology from which it was made, so that a process which finds it traces nothing. Both depend on the
processor, whose folder they are in, on the compiler's release, and on the code that makes them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from flexclear.artifacts.disk import disk_limits, encode_with_digest, publish, read_checked
from flexclear.artifacts.paths import kernel_root
from flexclear.dynamics import memory as m
from flexclear.dynamics.compile import functions
from flexclear.dynamics.compile.folder import writable
from flexclear.dynamics.routines.calls import CallList
from flexclear.dynamics.routines.emission import interpreter_text, routine_text
from flexclear.dynamics.specialise import topology as topologies
from flexclear.workflow.fingerprint import TREE, library_version, sources_of

#: what makes lists and their code
MAKERS = tuple(
    f"flexclear.dynamics.{name}"
    for name in ("mechanics", "memory", "routines", "specialise", "contact", "loads", "vectors")
)


@dataclass(frozen=True, eq=False)
class LoadedList:
    """A list of calls as the interpreter reads it.

    interpreter: its address.  codes: address per call.  offsets: of the runs of all calls, in their stretches of f and
    w where they have some (`specialise.topology`).  begins: per call, the index of its first one.  parts: ends of all
    parts.  size: number of results.
    """

    interpreter: int
    codes: np.ndarray
    offsets: np.ndarray
    begins: np.ndarray
    parts: list[int]
    size: int

    def instance(self, h: np.ndarray) -> ListInstance:
        """Return the list with results of its own; h: with the starts of its stretches in f and w."""
        return ListInstance(self, h)


#: bytes of a word
WORD = 8
#: lists of this process, by their files
loaded: dict[Path, LoadedList] = {}


class ListInstance:
    """A list of calls with its results, for one engine. words: what the interpreter reads (`routines.emission`), for
    part after part."""

    def __init__(self, loaded: LoadedList, h: np.ndarray) -> None:
        self.loaded, self.results = loaded, np.zeros(loaded.size)
        stretch, inside = topologies.stretch_and_offset(loaded.offsets)
        self._offsets = (np.where(stretch >= 0, h[stretch], 0) + inside).astype(np.int32)
        self._starts = (self._offsets.ctypes.data + self._offsets.itemsize * loaded.begins).astype(np.int64)
        codes, starts, results = (table.ctypes.data for table in (loaded.codes, self._starts, self.results))
        parts = pairwise([0, *loaded.parts])
        words = [(end - k, codes + WORD * k, starts + WORD * k, results) for k, end in parts]
        self.words = np.array(words, dtype=np.int64)


def stored_list(
    topology: bytes, build: Callable[[], CallList], report: Callable[[str], None], place: int | None = m.CALLS
) -> LoadedList:
    """Return the list of a topology, from disk or built; `report` receives a message before routines are compiled.

    place: in the header, where its interpreter finds it; None where that is given the list.
    """
    name = _name(_interpreter(place) + topology)
    path = writable(kernel_root(), report) / f"flexclear_routine_list_{name}{functions.CODE}"
    if path not in loaded:
        table = read_checked(path)
        at = functions.stored_codes(table["names"]) if table else None
        if table and at:
            loaded[path] = _list_of_table(table, at)
        else:
            calls = build()
            loaded[path] = load(calls, report, place)
            with disk_limits(path.parent):
                publish(path, encode_with_digest(_table(calls, place)))
    return loaded[path]


def load(calls: CallList, report: Callable[[str], None], place: int | None = m.CALLS) -> LoadedList:
    """Return a list ready to run; the arguments are those of `stored_list`."""
    table = _table(calls, place)
    texts = [partial(interpreter_text, place), *(partial(routine_text, code) for code in calls.codes)]
    return _list_of_table(table, functions.addresses_of_texts(dict(zip(table["names"], texts, strict=True)), report))


def _table(calls: CallList, place: int | None) -> dict[str, list]:
    """Return a list as numbers: names of the interpreter and its codes, code of each call, and offsets of its runs."""
    number = {id(code): k for k, code in enumerate(calls.codes, start=1)}
    return {
        "names": [_name(content) for content in (_interpreter(place), *(code.digest for code in calls.codes))],
        "codes": [number[id(call.code)] for call in calls.calls],
        "counts": [len(call.offsets) for call in calls.calls],
        "offsets": [offset for call in calls.calls for offset in call.offsets],
        "parts": calls.ends or [len(calls.calls)],
        "size": [calls.size],
    }


def _list_of_table(table: dict[str, list], at: dict[str, int]) -> LoadedList:
    addresses = np.array([at[name] for name in table["names"]], dtype=np.int64)
    begins = np.cumsum([0, *table["counts"]])[:-1]
    offsets = np.array(table["offsets"], dtype=np.int64)
    return LoadedList(int(addresses[0]), addresses[table["codes"]], offsets, begins, table["parts"], table["size"][0])


@cache
def _interpreter(place: int | None) -> bytes:
    """Return the interpreter's text, which reads places of h: the declarations of effects move them."""
    return interpreter_text(place).encode()


@cache
def _makers() -> bytes:
    """Return version and digests of all that lists and their code depend on besides their content."""
    known = sources_of(TREE, kernel_root() / "code.json")
    return " ".join([library_version("llvmlite"), *map(known.digest, MAKERS)]).encode()


def _name(content: bytes) -> str:
    return hashlib.sha256(_makers() + content).hexdigest()[:20]
