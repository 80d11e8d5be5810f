"""Files of others are read by a child process, with limits of memory, of time and of what it may answer.

Readers are large, and parts of them are written in C: a file that was damaged, or made to harm, ends or hangs the
child, and is refused here in words. The child is started when the first such file is read, and reused for the next.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flexclear.pipeline.core import machine
from flexclear.pipeline.core.errors import ResourceError
from flexclear.pipeline.core.external_files import wire
from flexclear.pipeline.core.workflow import file_dependencies

# started by a command, since multiprocessing would run the user's script again in the child
COMMAND = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
from flexclear.pipeline.core.external_files.child import main
main()
"""
#: memory of a reader [B]: so much, and so many times the size of its file; archives and text grow a hundredfold
LEAST, TIMES = 1e9, 200.0
#: what is always allowed, however little is free: less, and no library can be loaded
FLOOR = 256e6
#: processor time of a reader [s]: so much, and so much per byte (text takes up to 5e-7); on the clock so many times
SECONDS, PER_BYTE, PATIENCE = 30.0, 2e-6, 6.0
#: time to end by itself [s], for a child whose pipes are closed
GRACE = 1.0


class UnreadableError(ValueError):
    """A file cannot be read; its text says why, as the end of a sentence."""


@dataclass(frozen=True)
class Limits:
    """What reading one file may take: memory [B], processor time [s], time on the clock [s]."""

    memory: float
    seconds: float
    patience: float

    @staticmethod
    def of(path: Path) -> Limits:
        """Those of a file, by its size and that of its companions."""
        size = _size(path)
        seconds = SECONDS + PER_BYTE * size
        return Limits(max(FLOOR, min(LEAST + TIMES * size, allowed())), seconds, PATIENCE * seconds)


def _size(path: Path) -> int:
    """Bytes of a file and of those of its name with other endings, as far as its folder may be looked at."""
    try:
        companions = [other for other in path.parent.iterdir() if other.stem == path.stem and other.is_file()]
    except OSError:
        companions = [path]
    return sum(file.stat().st_size for file in companions)


def allowed() -> float:
    """Bytes of memory that what a file holds may take."""
    return machine.FRACTION * machine.memory()


@dataclass
class _Child:
    """A child and what guards it. owner: the process that started it, since a fork inherits the pipes."""

    process: subprocess.Popen[bytes]
    owner: int = field(default_factory=os.getpid)

    def end(self) -> int:
        """Its exit code; it is killed if it still runs."""
        if self.owner != os.getpid():
            return 0
        for pipe in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(OSError):  # what was not sent is nobody's any more
                pipe and pipe.close()
        try:
            return self.process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()


_child: _Child | None = None
_lock = threading.Lock()


def read(function: Callable[..., Any], path: Path, *arguments: Any, limits: Limits | None = None) -> Any:
    """What ``function(path, *arguments)`` gives in the child, as far as `wire` can carry it.

    function: at the top of a module, which the child imports.  `file_dependencies` records which files it opened.
    Raises UnreadableError for what cannot be read, or takes more than it may; ResourceError where the machine has
    too little, or a file changes meanwhile.
    """
    path = path.absolute()
    limits = Limits.of(path) if limits is None else limits
    asked = {
        "function": f"{function.__module__}:{function.__qualname__}",
        "path": str(path),
        "arguments": list(arguments),
        "memory": limits.memory,
        "seconds": limits.seconds,
    }
    with _lock:
        answer = _answer(asked, limits)
    if "failure" in answer:
        if answer["failure"] == "resource":
            raise ResourceError(str(answer["words"]))
        words = {"memory": _too_large(limits)}
        raise UnreadableError(words.get(answer["failure"], str(answer.get("words"))))
    file_dependencies.add(answer["read"], path.parent)
    return answer["value"]


def _answer(asked: dict[str, Any], limits: Limits) -> dict[str, Any]:
    """What the child says; it is ended, and replaced at the next call, where that is nothing of use."""
    global _child
    child = _running()
    late = threading.Event()

    def give_up() -> None:
        late.set()
        child.process.kill()

    timer = threading.Timer(limits.patience, give_up)
    timer.daemon = True
    timer.start()
    stdin, stdout = child.process.stdin, child.process.stdout
    assert stdin is not None
    assert stdout is not None
    answer: dict[str, Any] | None = None
    reason = "what its reader answers is no message"
    try:
        wire.send(stdin, asked)
        received = wire.receive(stdout, limits.memory)
        answer = received if "failure" in received or {"value", "read"} <= received.keys() else None
    except (OSError, EOFError):
        reason = _end_of(child, late.is_set(), limits)
    except (ValueError, TypeError, KeyError, AttributeError, MemoryError):
        reason += f", or has more than {machine.size(limits.memory)}"
    finally:
        timer.cancel()
        if answer is None:  # also where Ctrl-C came: half of an answer may be on its way
            child.end()
            _child = None
    return {"failure": "end", "words": reason} if answer is None else answer


def _running() -> _Child:
    """The child, started if there is none."""
    global _child
    if _child is None or _child.owner != os.getpid() or _child.process.poll() is not None:
        if _child is None:
            atexit.register(end)
        else:
            _child.end()
        thread = "main" if threading.current_thread() is threading.main_thread() else "other"
        _child = _Child(_started(json.dumps([str(folder) for folder in sys.path]), str(os.getpid()), thread))
    return _child


def _started(*arguments: str) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            [sys.executable, "-c", COMMAND, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError as error:
        raise ResourceError(f"no process can be started that reads files of others: {error}") from None


def end() -> None:
    """End the child, if there is one."""
    global _child
    if _child is not None:
        _child.end()
        _child = None


def _end_of(child: _Child, late: bool, limits: Limits) -> str:
    """Why a child is gone that should have answered."""
    code = child.end()
    if late:
        return f"it takes more than {limits.patience:.3g} s"
    if code == -getattr(signal, "SIGXCPU", 0) != 0:
        return f"it takes more than {limits.seconds:.3g} s of the processor"
    if code == -getattr(signal, "SIGKILL", 0) != 0:
        return "its reader was ended by the system, which may be short of memory"
    cause = signal.strsignal(-code) if code < 0 else f"exit code {code}"
    return f"its reader broke down ({cause}); it may take {machine.size(limits.memory)} of memory"


def _too_large(limits: Limits) -> str:
    return f"it takes more than {machine.size(limits.memory)} of memory"
