"""A task: one artifact to be brought up to date; its facts, its key, and the reasons to run it again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from flexclear.artifacts.disk import digest_of
from flexclear.workflow.fingerprint import CORE, Sources

#: attribute of functions that `given_arrays` marks
ARRAYS = "given_arrays"
#: key of the context that holds the file of a task's scene, for messages
PATH = "path"
#: created once: `json.dumps` with options creates an encoder for every value
_JSON = json.JSONEncoder(ensure_ascii=False, default=str)


Stage = TypeVar("Stage", bound=Callable[..., Any])


def given_arrays(run: Stage) -> Stage:
    """Mark the function of a stage that receives its inputs as `LabelledArrays`, not as xarray datasets."""
    setattr(run, ARRAYS, True)
    return run


@dataclass(frozen=True, eq=False)
class Task:
    """The function to run, its inputs, and the folder where its files are shown.

    stage: name of the stage and of its folder in the cache.
    part: body (or figure) of the task; empty when the stage has one artifact per scene.
    run: ``"module:function"``, called as ``run(params, inputs, progress)``; see `execute`.
    params: all that the result may depend on, as JSON, besides `inputs` and `files`.
    files: every file that the function opens, by its name for users: its content counts, its path does not.
    context: further arguments that must not affect the result: paths of files, names for messages.
    inputs: tasks whose artifact ``nc`` the function receives, by name.
    code: packages and modules, besides its own module and `fingerprint.CORE`, whose code decides its result.
    folder: folder where its files are shown, below the results folder; empty: nowhere.
    names: file of the artifact -> name shown there; a file that is not listed keeps its name.
    check: ``"module:function"``, called as ``check(params)`` before any task runs; it raises InputError.
    exclusive: whether no other task may run at the same time (measurements of time).
    """

    stage: str
    scene: str
    run: str
    params: Mapping[str, Any]
    folder: str = ""
    part: str = ""
    inputs: Mapping[str, Task] = field(default_factory=dict)
    code: tuple[str, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    exclusive: bool = False
    context: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Path] = field(default_factory=dict)
    check: str = ""

    @property
    def label(self) -> str:
        """Name within the scene, e.g. ``mesh rod1``."""
        return f"{self.stage} {self.part}".strip()


def in_order(tasks: list[Task]) -> list[Task]:
    """Return `tasks` and all their inputs, each once, inputs first."""
    ordered: dict[Task, None] = {}

    def visit(task: Task) -> None:
        for above in task.inputs.values():
            visit(above)
        ordered.setdefault(task)

    for task in tasks:
        visit(task)
    return list(ordered)


def facts(task: Task, digests: Mapping[str, str], sources: Sources) -> dict[str, str]:
    """Return everything that decides the artifact, in words: kind and name -> value.

    digests: digest of each known input; leave one out to compare the rest.
    """
    result = {f"parameter {name}": value for name, value in flatten(task.params)}
    result |= {f"input {name}": digest for name, digest in digests.items()}
    result |= contents(task)
    result |= sources.code((*CORE, *task.code, task.run.partition(":")[0]))
    return {**result, "function": task.run}


def contents(task: Task) -> dict[str, str]:
    """Return the facts of the files that a task opens, in their current state."""
    return {f"file {name}": _digest(path) for name, path in sorted(task.files.items())}


def _digest(path: Path) -> str:
    """Return the SHA-256 digest of a file; "absent" for a missing or special file, which its reader refuses."""
    try:
        return digest_of(path)
    except (OSError, ValueError):
        return "absent"


def key(task_facts: Mapping[str, str]) -> str:
    """Return the name of the artifact in the cache: SHA-256 digest of the facts, 32 hexadecimal digits."""
    text = json.dumps(task_facts, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def flatten(node: Any, where: str = "") -> list[tuple[str, str]]:
    """Return key path and canonical text of every leaf of a JSON tree; floats by repr.

    Empty tables and lists are leaves, so that adding an empty one is noticed. Values that JSON does not have (a date or
    a nan in a recipe) are stored as text; the stage will refuse them.
    """
    if isinstance(node, Mapping) and node:
        below = [(str(name), value) for name, value in node.items()]
    elif isinstance(node, (list, tuple)) and any(isinstance(x, (dict, list, tuple, Mapping)) for x in node):
        below = [(str(number), value) for number, value in enumerate(node)]
    else:
        return [(where, _JSON.encode(node))]
    return [leaf for name, value in below for leaf in flatten(value, f"{where}.{name}" if where else name.lstrip("."))]


def reasons(new: Mapping[str, str], last: Mapping[str, str] | None, unknown: frozenset[str] = frozenset()) -> list[str]:
    """Return the reasons to run again, in words; empty when nothing changed.

    last: facts of the last artifact, None when there is none. unknown: names of inputs that will themselves be made
    again; they are not compared.
    """
    if last is None:
        return ["never run"]
    skipped = {f"input {name}" for name in unknown}
    names = sorted((new.keys() | last.keys()) - skipped)
    return [_reason(name, last.get(name), new.get(name)) for name in names if last.get(name) != new.get(name)]


def _reason(fact: str, old: str | None, new: str | None) -> str:
    kind, _, name = fact.partition(" ")
    if kind in ("parameter", "library"):
        what = f"{name}: " if kind == "parameter" else f"library {name}: "
        return f"{what}{'(absent)' if old is None else old} -> {'(absent)' if new is None else new}"
    verb = "is new" if old is None else "is no longer used" if new is None else "changed"
    return f"{kind} {name} {verb}".replace("function  ", "function ")
