"""Unfinished work of ensembles and sections on disk: a killed task continues with results equal to the last bit.

Such a task does its work in pieces: members, or periods that continue from each other. The name of a piece covers all
that decides its content, so that a later attempt at the same task requests the same pieces; those on disk are not
computed again. They lie next to the later artifact, ``cache/<stage>/<key>.<piece>.part``, each with a digest that only
its user can compute, and hold arrays only, no code. They are removed when the artifact is stored.
"""

from __future__ import annotations

import contextlib
import hmac
import io
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

from flexclear.artifacts.disk import publish, read_whole, temporary
from flexclear.artifacts.paths import kernel_root
from flexclear.system.platforms import replace

#: interval at which unfinished work is written [s], and the largest fraction of the time spent on slow writing
WRITING_INTERVAL, WRITING_FRACTION = 20.0, 0.05
#: number of characters of the digest at the beginning of a piece's file, before a line end
DIGEST = 64
#: bytes of the secret from which digests are computed
SECRET = 32


@dataclass
class Journal:
    """The pieces of one task, which any of its threads may store.

    folder, key: folder of the files and beginning of their names.
    """

    folder: Path
    key: str
    clock: Callable[[], float] = time.monotonic
    _waiting: dict[str, Callable[[], Mapping[str, Any]]] = field(default_factory=dict)
    _written: float = field(default_factory=time.monotonic)
    _took: float = 0.0
    _lock: Lock = field(default_factory=Lock)

    def find(self, name: str) -> dict[str, Any] | None:
        """Return the arrays of a piece stored by an earlier attempt; None when it is absent or damaged."""
        import numpy as np

        try:
            whole = read_whole(self._path(name))
        except OSError:
            return None
        content = whole[DIGEST + 1 :]
        if not hmac.compare_digest(signature(content).encode(), whole[:DIGEST]):
            return None
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            return {key: file[key] for key in file.files}

    def store(self, name: str, arrays: Callable[[], Mapping[str, Any]]) -> None:
        """Store a piece, replacing an earlier one of its name; `arrays` is called when the piece is written."""
        with self._lock:
            self._waiting[name] = arrays
            due = self.clock() - self._written > max(WRITING_INTERVAL, self._took / WRITING_FRACTION)
        if due:
            self.write()

    def write(self) -> None:
        """Write the waiting pieces; on a full disk only they are lost."""
        import numpy as np

        with self._lock:
            begun = self.clock()
            with contextlib.suppress(OSError):
                self.folder.mkdir(parents=True, exist_ok=True)
                for name, arrays in self._waiting.items():
                    buffer = io.BytesIO()
                    np.savez(buffer, allow_pickle=False, **arrays())
                    content = buffer.getvalue()
                    publish(self._path(name), signature(content).encode() + b"\n" + content)
                self._waiting = {}
            self._written, self._took = self.clock(), self.clock() - begun

    def remove(self) -> None:
        """Remove the pieces of a finished task."""
        for path in self.folder.glob(f"{self.key}.*.part"):
            path.unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        return self.folder / f"{self.key}.{name}.part"


#: threads inherit the journal of the task that gave them their work, unless they work on a task of their own
_current: ContextVar[Journal | None] = ContextVar("journal", default=None)


def current() -> Journal | None:
    """Return the journal of the current task; None where nothing is stored."""
    return _current.get()


@contextlib.contextmanager
def storage(folder: Path, key: str) -> Iterator[Journal]:
    """Yield the journal of a task, and write its pieces when the work fails or is stopped; the caller removes them."""
    journal = Journal(folder, key)
    before = _current.set(journal)
    try:
        yield journal
    except BaseException:
        journal.write()
        raise
    finally:
        _current.reset(before)


def signature(content: bytes) -> str:
    """Return a hexadecimal digest that only this user can compute, with as many characters as that of `disk.sha256`.

    The content of a work array decides where compiled code reads and writes, so work that somebody else put into a
    folder of results must not be continued. The secret lies next to the compiled kernels, in the user's own folder.
    """
    return hmac.new(_secret(), content, "sha256").hexdigest()


@cache
def _secret() -> bytes:
    """Return the user's secret; where none can be stored, one of this process, whose work no other continues."""
    path = kernel_root() / "seal"
    try:
        if not path.is_file() or path.stat().st_size != SECRET:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with temporary(path) as made:
                with open(os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                    file.write(os.urandom(SECRET))
                replace(made, path)
        return path.read_bytes()  # when processes write one concurrently, the last secret is valid for all
    except OSError:
        return os.urandom(SECRET)
