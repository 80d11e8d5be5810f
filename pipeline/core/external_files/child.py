"""The process that reads files of others: what it may take is limited, and its end harms nobody."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
from pathlib import Path
from typing import IO, Any

from flexclear.pipeline.core import system
from flexclear.pipeline.core.errors import ResourceError, shown
from flexclear.pipeline.core.external_files import wire
from flexclear.pipeline.core.workflow import family, file_dependencies

#: bytes of a request: names, numbers, and paths
LARGEST_REQUEST = 1_000_000


def serve(parent: int, *, by_main_thread: bool) -> None:
    """Answer requests on the standard streams until there are no more; arguments as of `family.follow`."""
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):  # libraries write to them what they like
        os.dup2(nothing, stream)
    tempfile.gettempdir()  # to find it takes writing there, which it will not be able to
    family.follow(parent, by_main_thread=by_main_thread)
    while True:
        try:
            asked = wire.receive(requests, LARGEST_REQUEST)
        except EOFError:
            return
        _answer(asked, answers)


def _answer(asked: dict[str, Any], answers: IO[bytes]) -> None:
    path = Path(asked["path"])
    system.limit_itself(asked["memory"], asked["seconds"])
    try:
        module, _, name = asked["function"].partition(":")
        function = getattr(importlib.import_module(module), name)
        with file_dependencies.watched(path.parent) as read, file_dependencies.ordinary_only():
            file_dependencies.note(path)  # some readers are not written in Python
            value = function(path, *asked["arguments"])
        wire.send(answers, {"value": value, "read": read})
    except (MemoryError, BrokenPipeError) as error:
        wire.send(answers, {"failure": "memory" if isinstance(error, MemoryError) else "gone"})
    except ResourceError as error:
        wire.send(answers, {"failure": "resource", "words": str(error)})
    except Exception as error:  # damaged files make readers fail in ways of their own
        wire.send(answers, {"failure": "content", "words": shown(str(error) or type(error).__name__)})


def main() -> None:
    """Main function of the process that `isolated` starts."""
    serve(int(sys.argv[2]), by_main_thread=sys.argv[3] == "main")
