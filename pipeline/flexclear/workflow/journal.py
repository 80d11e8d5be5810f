"""Unfinished work of ensembles and sections on disk: a killed task continues with results equal to the last bit.

Such a task does its work in pieces: members, or periods that continue from each other. The name of a piece covers all
that decides its content, so that a later attempt at the same task requests the same pieces; those on disk are not
computed again. They lie next to the later artifact, ``cache/<stage>/<key>.<piece>.part``, as npz files of arrays, whose
checksums show damage, without pickled objects. They are removed when the artifact is stored.
"""

from __future__ import annotations

import contextlib
import io
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any
from zipfile import BadZipFile

from flexclear.artifacts.disk import publish

#: interval at which unfinished work is written [s], and the largest fraction of the time spent on slow writing
WRITING_INTERVAL, WRITING_FRACTION = 20.0, 0.05


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
            with np.load(self._path(name), allow_pickle=False) as file:
                return {key: file[key] for key in file.files}
        except (OSError, ValueError, EOFError, BadZipFile, zlib.error):
            return None

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
                    publish(self._path(name), buffer.getvalue())
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


def current_journal() -> Journal | None:
    """Return the journal of the current task; None where nothing is stored."""
    return _current.get()


@contextlib.contextmanager
def keep_journal(folder: Path, key: str) -> Iterator[Journal]:
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
