"""Processor time of one program, by parts of the work: ``python -m benchmarks.command_parts flexclear run SCENE``.

The program runs in a process of its own, since imports are a part. The last line of the output is a table as JSON:
part -> seconds. The time of a part excludes the parts nested in it. Threads that run concurrently count separately.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from functools import wraps
from importlib import _bootstrap
from runpy import run_module
from threading import Lock, local
from typing import Any

IMPORTS, REST = "imports", "rest"
_RUN = "flexclear.dynamics"
#: module -> function -> part to which the function's time counts
PARTS: Mapping[str, Mapping[str, str]] = {
    "flexclear.scene.load": {"load_scene": "scene"},
    "flexclear.workflow.task": {"facts": "keys", "key": "keys"},
    "flexclear.artifacts.store": {"Store.find": "keys", "_write_content": "writing"},
    f"{_RUN}.run.evaluation.engine": {"prepare": "assembling"},
    f"{_RUN}.model.model": {"tabulate": "assembling"},
    f"{_RUN}.run.horizon.horizon": {"Pair.perturbed_run": "integrating"},
    f"{_RUN}.run.run": {"RunInParts._advanced": "integrating", "observe_run": "recording"},
    f"{_RUN}.record.dataset": {"record_run": "recording"},
    "flexclear.post.single_run.series": {"derive_arrays": "deriving"},
}
_spent: dict[str, float] = {}
_adding = Lock()


class _Inside(local):
    """Stack, for each thread, of the time [s] that nested parts have used inside each active part."""

    def __init__(self) -> None:
        self.seconds: list[float] = []


_inside = _Inside()


def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function wrapped so that its own time is added to a part."""

    @wraps(function)
    def called(*arguments: Any, **named: Any) -> Any:
        begun, inside = time.thread_time(), _inside.seconds
        inside.append(0.0)
        try:
            return function(*arguments, **named)
        finally:
            whole, below = time.thread_time() - begun, inside.pop()
            with _adding:
                _spent[part] = _spent.get(part, 0.0) + whole - below
            if inside:
                inside[-1] += whole

    return called


def listen() -> None:
    """Time imports from now on, and wrap the functions of `PARTS` when their modules are imported."""
    find_and_load = timed(IMPORTS, _bootstrap._find_and_load)  # type: ignore[attr-defined]

    def loaded(name: str, import_: Any) -> Any:
        found = find_and_load(name, import_)
        for place, part in PARTS.get(name, {}).items():
            holder, _, attribute = place.rpartition(".")
            owner = getattr(found, holder) if holder else found
            function = getattr(owner, attribute)
            if not hasattr(function, "__wrapped__"):
                setattr(owner, attribute, timed(part, function))
        return found

    _bootstrap._find_and_load = loaded  # type: ignore[attr-defined]


def main(arguments: list[str]) -> int:
    """Run the program, a package and its arguments, and print the seconds of its parts as JSON."""
    started = time.process_time()
    listen()
    sys.argv, code = arguments, 0
    try:
        run_module(arguments[0], run_name="__main__", alter_sys=True)
    except SystemExit as end:
        code = int(end.code or 0)
    whole = time.process_time()
    _spent["interpreter"] = started
    _spent[REST] = whole - sum(_spent.values())
    print(json.dumps(_spent))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
