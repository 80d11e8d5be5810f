"""A second process that compiles concurrently with this one, into the same folder.

It takes files that no process is compiling and writes their code to disk. If it fails, this process compiles the
missing files, and reports files that cannot be compiled.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.dynamics.compile.files import file_lock, load_file
from flexclear.workflow.cores import has_free_processor

if TYPE_CHECKING:
    import subprocess

# started by a command, since multiprocessing would run the user's script again in the child
COMMAND = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
from flexclear.dynamics.compile.compiler_process import work
work(sys.argv[2:])
"""


@contextmanager
def second_process(paths: list[Path]) -> Iterator[subprocess.Popen[bytes] | None]:
    """Run a second process that compiles the files, in this order; yield None where none is started.

    At most one runs per folder of kernels, whichever process started it.
    """
    with ExitStack() as stack:
        process = None
        if len(paths) > 1 and is_useful():
            alone = stack.enter_context(file_lock(paths[0].with_name("compiler"), wait=False))
            process = _start(paths) if alone else None
        if process is not None:
            stack.enter_context(process)  # waits for it, so that it is no zombie
            stack.callback(process.kill)  # first: all is compiled, or this process was interrupted
        yield process


def is_useful() -> bool:
    """Return True when a second process is useful and can be started."""
    # a program packed into one file would start itself again
    startable = bool(sys.executable) and not getattr(sys, "frozen", False)
    return startable and has_free_processor()


def _start(paths: list[Path]) -> subprocess.Popen[bytes] | None:
    import subprocess  # here: not needed when all code is on disk

    folders = json.dumps([str(folder) for folder in sys.path])
    try:
        return subprocess.Popen(
            [sys.executable, "-c", COMMAND, folders, *map(str, paths)],
            stdin=subprocess.PIPE,  # ends when this process does
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return None


def work(paths: list[str]) -> None:
    """Compile files as the second process."""
    threading.Thread(target=_follow_parent, daemon=True).start()
    for path in paths:
        load_file(Path(path), lambda _: None)


def _follow_parent() -> None:
    os.read(0, 1)
    os._exit(1)
