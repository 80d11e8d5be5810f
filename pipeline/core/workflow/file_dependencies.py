"""Which files a task opens: what they hold decides its result, so it is among the facts of its key.

Taken from what was opened, not from a list: formats have companions (`b.node` next to `b.ele`) that only their reader
knows. Python reports every file that it opens; what a library in C opens is noted by whoever calls that
library (`note`).
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.artifacts.paths import kernel_root
from flexclear.pipeline.core.errors import ResourceError

#: what is in the facts for a file that is not there, and for what is no file
ABSENT, SPECIAL = "absent", "no file"
#: code counts by module and by library, see `fingerprint`
CODE = (".py", ".pyc", ".so", ".pyd", ".pth")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


@dataclass
class Opened:
    """Absolute path -> digest of what was there when it was first opened; paths that the task wrote itself."""

    outside: tuple[str, ...]
    read: dict[str, str] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)
    busy: bool = False

    def see(self, path: Any, writing: bool) -> None:
        """Note a file, unless it is the task's own or belongs to the system or the program."""
        if self.busy or isinstance(path, int):
            return
        name = os.path.abspath(os.fsdecode(path))
        if writing:
            self.written.add(name)
        elif name not in self.read and name not in self.written and not self._left_out(name):
            self.busy = True  # opens the file, too
            try:
                self.read[name] = digest(name)
            finally:
                self.busy = False

    def _left_out(self, name: str) -> bool:
        if name.endswith(CODE) or name.startswith(self.outside) or f"{os.sep}flexclear_kernels_" in name:
            return True
        # Matplotlib's list of fonts, in a temporary folder where the home folder cannot be written
        if name.startswith(os.environ.get("MPLCONFIGDIR") or "\0"):
            return True
        # where modules are searched for there may be archives, which need not be there; editable installs add bare
        # names
        return name in map(os.path.abspath, sys.path)


_current: Opened | None = None
_ordinary = False


def note(path: Path) -> None:
    """A file is about to be read in a way that Python does not report."""
    if _current is not None:
        _current.see(path, writing=False)


@contextmanager
def ordinary_only() -> Iterator[None]:
    """Meanwhile Python opens ordinary files alone; what a file of somebody else names may be a device without end.

    Opening another one raises OSError.
    """
    global _ordinary
    _listen()
    before, _ordinary = _ordinary, True
    try:
        yield
    finally:
        _ordinary = before


@contextmanager
def watched(base: Path, outside: Iterable[Path] = ()) -> Iterator[dict[str, str]]:
    """Filled at the end: path relative to `base` -> digest, of every file that was opened to be read meanwhile.

    outside: folders whose files do not count, as those of the system, of libraries and of programs' own state do not;
    nor do compiled kernels, which count by their sources.
    Raises ResourceError when a file changed meanwhile.
    """
    global _current
    _listen()
    places = (*_system(), *(str(folder) for folder in (kernel_root(), *outside)))
    watched_files: dict[str, str] = {}
    before, _current = _current, Opened(tuple(f"{place.rstrip(os.sep)}{os.sep}" for place in places))
    seen = _current
    try:
        yield watched_files
    finally:
        _current = before
    temporary = tempfile.gettempdir()
    for name, then in seen.read.items():
        now = digest(name)
        if name in seen.written or (now == ABSENT and name.startswith(temporary)):
            continue  # the process's own: made by a task, or by a library for itself
        if now != then:
            raise ResourceError(f"{name} changed while it was read; run again")
        watched_files[_place(name, base)] = then


def _place(name: str, base: Path) -> str:
    """A file relative to a folder; on another drive there is no way from there."""
    try:
        return os.path.relpath(name, base)
    except ValueError:
        return name


def digests(names: Iterable[str], base: Path) -> dict[str, str]:
    """Content of the files in these folders, as `watched` gives it."""
    return {name: digest(os.path.normpath(base / name)) for name in names}


def digest(path: str) -> str:
    """The sha256 of a file; what is no file, or is not there, has a word instead."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            return SPECIAL
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ABSENT


def facts(file_digests: Mapping[str, str]) -> dict[str, str]:
    """As facts of a key."""
    return {f"file {name}": value for name, value in sorted(file_digests.items())}


@cache
def _listen() -> None:
    """From now on Python reports what it opens; a hook cannot be taken away again."""

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and _ordinary:
            _require_ordinary(arguments[0])
        if event == "open" and _current is not None:
            _current.see(arguments[0], writing=bool((arguments[2] or 0) & WRITING))

    sys.addaudithook(hook)


def _require_ordinary(path: Any) -> None:
    """OSError for devices and pipes; the audit hook's error ends the attempt to open."""
    if isinstance(path, int):
        return
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return  # opening it will tell
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OSError(errno.EINVAL, "it is no ordinary file", os.fsdecode(path))


@cache
def _system() -> tuple[str, ...]:
    """Folders of the system, of Python and its libraries, and of programs' own state in the home folder."""
    home = os.path.expanduser("~")
    state = os.environ.get("XDG_CACHE_HOME"), os.environ.get("XDG_CONFIG_HOME")
    paths = sysconfig.get_paths()  # not its prefix: an environment may be the folder of a project itself
    own = {paths[name] for name in ("stdlib", "platstdlib", "purelib", "platlib", "scripts")}
    own |= {os.path.realpath(folder) for folder in own}
    system = (
        "/proc",
        "/sys",
        "/dev",
        "/etc",
        "/lib",
        "/lib64",
        "/usr/lib",
        "/usr/lib64",
        "/usr/local/lib",
        "/usr/share",
    )
    programs = [f"{home}/{name}" for name in (".cache", ".config", ".local")] if home != "~" else []
    return (*system, *programs, *filter(None, state), *sorted(own))
