"""Unfinished work of ensembles and sections on disk, so that what was killed continues where it was, to the last bit.

Such a task does its work in pieces: members, or periods that continue from each other. A piece is named by all that
decides it, so that a later attempt at the same task asks for the same pieces; those on disk are not computed again.
They lie next to the later artifact, ``cache/<stage>/<key>.<piece>.part``, each with a digest that only its user
can make, and hold arrays only, no code. They are removed when the artifact is stored.
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

from flexclear.pipeline.core.artifacts.disk import publish, read_whole, temporary
from flexclear.pipeline.core.artifacts.paths import kernel_root
from flexclear.pipeline.core.system.platforms import replace

#: how often unfinished work is written [s], and the fraction of the time that writing may take where it is slow
WRITING_INTERVAL, WRITING_FRACTION = 20.0, 0.05
#: a piece's file begins with a digest of so many characters, and a line's end
DIGEST = 64
#: bytes of the secret with which digests are made
SECRET = 32


@dataclass
class Journal:
    """The pieces of one task, whose threads may all store some.

    folder, key: where they lie, and what their names begin with.
    """

    folder: Path
    key: str
    clock: Callable[[], float] = time.monotonic
    _waiting: dict[str, Callable[[], Mapping[str, Any]]] = field(default_factory=dict)
    _written: float = field(default_factory=time.monotonic)
    _took: float = 0.0
    _lock: Lock = field(default_factory=Lock)

    def find(self, name: str) -> dict[str, Any] | None:
        """Arrays of a piece that an earlier attempt stored; None where there is none, or it is damaged."""
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
        """Store a piece, instead of an earlier one of its name; `arrays` is called when it is written."""
        with self._lock:
            self._waiting[name] = arrays
            due = self.clock() - self._written > max(WRITING_INTERVAL, self._took / WRITING_FRACTION)
        if due:
            self.write()

    def write(self) -> None:
        """Write what waits; where the disk is full, nothing is lost but that."""
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
        """The task is done."""
        for path in self.folder.glob(f"{self.key}.*.part"):
            path.unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        return self.folder / f"{self.key}.{name}.part"


#: of each thread what it was when the thread was given its work, unless it works on a task of its own
_current: ContextVar[Journal | None] = ContextVar("journal", default=None)


def current() -> Journal | None:
    """The journal of the task that is worked on; None where nothing is stored."""
    return _current.get()


@contextlib.contextmanager
def storage(folder: Path, key: str) -> Iterator[Journal]:
    """Meanwhile unfinished work is written, at last where the work fails or is stopped; its caller removes it."""
    made = Journal(folder, key)
    before = _current.set(made)
    try:
        yield made
    except BaseException:
        made.write()
        raise
    finally:
        _current.reset(before)


def signature(content: bytes) -> str:
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
