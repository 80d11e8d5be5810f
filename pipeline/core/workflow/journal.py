"""Unfinished work of a task on disk, so that what was killed continues where it was, to the last bit.

A task does its work in pieces, one integration each. A piece is named by all that decides it, so that a later
attempt at the same task asks for the same pieces, in the same order; what it finds, it need not do again. Pieces lie
next to the artifact that shall come of them, ``cache/<stage>/<key>.<piece>.part``, each with a digest that only
its user can make, and hold numbers only: arrays and JSON, no code. They go when the artifact is there.
"""

from __future__ import annotations

import contextlib
import hmac
import io
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any

from flexclear.pipeline.core.artifacts.disk import publish, read_whole, temporary
from flexclear.pipeline.core.artifacts.paths import kernel_root
from flexclear.pipeline.core.system.platforms import replace

#: how often unfinished work is written [s], and the fraction of the time that writing may take where it is slow
EVERY, FRACTION = 20.0, 0.05
#: what a file of a piece begins with is a digest of so many characters, and a line's end
DIGEST = 64
#: bytes of the secret with which digests are made
SECRET = 32


@dataclass(frozen=True)
class State:
    """What a piece needs to continue.

    arrays: by name.  notes: what JSON can say.  grown: rows that are only added to.  seconds: what it has taken so far.
    """

    arrays: Mapping[str, Any]
    notes: Mapping[str, Any]
    grown: Any
    seconds: float = 0.0


@dataclass
class Journal:
    """The pieces of one task, whose threads may all ask.

    folder, key: where they lie, and what their names begin with.
    restored: processor time [s] that pieces took in earlier attempts.  aside: what keeping them has taken of this one.
    """

    folder: Path
    key: str
    clock: Callable[[], float] = time.monotonic
    restored: float = 0.0
    aside: float = 0.0
    _waiting: dict[str, State | Callable[[], State]] = field(default_factory=dict)
    _asked: dict[str, int] = field(default_factory=dict)
    _chunks: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    _covered: set[str] = field(default_factory=set)
    _written: float = field(default_factory=time.monotonic)
    _saved: dict[str, float] = field(default_factory=dict)
    _took: float = 0.0
    _lock: RLock = field(default_factory=RLock)

    def name(self, digest: str) -> str:
        """Name of the piece that is asked for next with this digest of all that decides it: work may be repeated."""
        with self._lock:
            count = self._asked.get(digest, 0)
            self._asked[digest] = count + 1
            made = f"{digest[:24]}-{count}"
            self._saved[made] = self._written
        return made

    def find(self, name: str) -> State | None:
        """What an earlier attempt left of a piece; None where there is nothing, or something is damaged."""
        import numpy as np

        entry = self._read(name)
        if entry is None:
            return None
        arrays, notes = entry
        chunks, rows = [(int(count), str(digest)) for count, digest in notes["chunks"]], []
        for k, (_, digest) in enumerate(chunks):
            more = self._read(f"{name}-{k}", digest)
            if more is None:
                return None
            rows.append(more[0]["rows"])
        with self._lock:
            self._chunks[name] = chunks
            self.restored += float(notes["seconds"])
        return State(arrays, notes["notes"], np.concatenate(rows), float(notes["seconds"]))

    def due(self, name: str = "") -> bool:
        """Whether it is time to write; a piece of that name, whenever others were written, as threads do next to it."""
        return self.clock() - self._saved.get(name, self._written) > max(EVERY, self._took / FRACTION)

    def finish(self, name: str, state: State) -> None:
        """A piece is done; it is written with what is written next."""
        with self._lock:
            self._waiting[name] = state
            self._saved.pop(name, None)
            if self.due():
                self.write()

    def cover(self, name: str, state: Callable[[], State]) -> None:
        """From this state on, which is asked for when it is written, the work needs none of the pieces so far."""
        with self._lock:
            self._covered |= {*self._waiting, *self._chunks} - {name}
            self._waiting = {name: state}
            if self.due():
                self.write()

    def write(self, name: str | None = None, state: State | None = None) -> None:
        """Write what waits, and this piece; where the disk is full, nothing is lost but that."""
        with self._lock:
            begun = self.clock()
            waiting = self._waiting | ({} if name is None or state is None else {name: state})
            with contextlib.suppress(OSError):
                self.folder.mkdir(parents=True, exist_ok=True)
                for piece, content in waiting.items():
                    self._put(piece, content() if callable(content) else content)
                self._waiting = {}
                for piece in self._covered:
                    self._drop(piece)
                self._covered = set()
            self._written, self._took = self.clock(), self.clock() - begun
            if name in self._saved:
                self._saved[name] = self._written

    @contextlib.contextmanager
    def uncounted(self) -> Iterator[None]:
        """What is done meanwhile is none of the work, whose time may be measured."""
        begun, before = time.process_time(), self.aside
        try:
            yield
        finally:
            self.aside = before + time.process_time() - begun

    def remove(self) -> None:
        """The task is done."""
        remove(self.folder / self.key)

    def _put(self, name: str, state: State) -> None:
        chunks = self._chunks.setdefault(name, [])
        have = sum(count for count, _ in chunks)
        if len(state.grown) > have or not chunks:
            digest = self._publish(f"{name}-{len(chunks)}", {"rows": state.grown[have:]}, {})
            chunks.append((len(state.grown) - have, digest))
        whole = {"chunks": chunks, "seconds": state.seconds, "notes": dict(state.notes)}
        self._publish(name, state.arrays, whole)

    def _drop(self, name: str) -> None:
        for k in range(len(self._chunks.pop(name, []))):
            self._path(f"{name}-{k}").unlink(missing_ok=True)
        self._path(name).unlink(missing_ok=True)

    def _publish(self, name: str, arrays: Mapping[str, Any], notes: Mapping[str, Any]) -> str:
        import numpy as np

        encoded = np.frombuffer(json.dumps(notes).encode(), np.uint8)
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, notes=encoded, **arrays)
        content = buffer.getvalue()
        digest = sealed(content)
        publish(self._path(name), digest.encode() + b"\n" + content)
        return digest

    def _read(self, name: str, digest: str | None = None) -> tuple[dict[str, Any], dict[str, Any]] | None:
        import numpy as np

        try:
            whole = read_whole(self._path(name))
        except OSError:
            return None
        content = whole[DIGEST + 1 :]
        noted = whole[:DIGEST].decode(errors="replace")
        if not hmac.compare_digest(sealed(content).encode(), noted.encode()) or digest not in (None, noted):
            return None
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        return arrays, json.loads(arrays.pop("notes").tobytes())

    def _path(self, name: str) -> Path:
        return self.folder / f"{self.key}.{name}.part"


def remove(task: Path) -> None:
    """The task of a journal, `folder/key`, is done."""
    for path in task.parent.glob(f"{task.name}.*.part"):
        path.unlink(missing_ok=True)


#: of each thread what it was when the thread was given its work, unless it works on a task of its own
_current: ContextVar[Journal | None] = ContextVar("journal", default=None)


def current() -> Journal | None:
    """The journal of the task that is worked on; None where nothing is stored."""
    return _current.get()


@contextlib.contextmanager
def storage(folder: Path, key: str) -> Iterator[Journal]:
    """Meanwhile unfinished work is written; whoever has stored what came of it removes it."""
    made = Journal(folder, key)
    before = _current.set(made)
    try:
        yield made
    finally:
        _current.reset(before)


def seconds() -> float:
    """Processor time of this process [s], as if the work had never been interrupted, and nothing of it were stored."""
    mine = _current.get()
    return time.process_time() + (mine.restored - mine.aside if mine is not None else 0.0)


def sealed(content: bytes) -> str:
    """Hexadecimal digest that only this user can make, of as many characters as that of `disk.sha256`.

    What a work space holds decides where compiled code reads and writes, so work that somebody else put into a folder
    of results must not be continued. The secret lies next to the compiled kernels, in the user's own folder.
    """
    return hmac.new(_secret(), content, "sha256").hexdigest()


@cache
def _secret() -> bytes:
    """The user's; where none can be stored, one of this process, whose work no other one continues with."""
    path = kernel_root() / "seal"
    try:
        if not path.is_file() or path.stat().st_size != SECRET:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with temporary(path) as made:
                with open(os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                    file.write(os.urandom(SECRET))
                replace(made, path)
        return path.read_bytes()  # of processes that make one at once, the last one's
    except OSError:
        return os.urandom(SECRET)
