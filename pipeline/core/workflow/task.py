"""A task: one artifact to be brought up to date. Its facts, its key, and why it would run again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from flexclear.pipeline.core.artifacts.disk import digest_of
from flexclear.pipeline.core.workflow.fingerprint import Sources

#: libraries that every artifact passes through on its way to disk
STORE = "flexclear.pipeline.core.artifacts.store"
#: attribute of functions that `given_arrays` marks
ARRAYS = "given_arrays"
#: made once: `json.dumps` with options makes one for every value
_JSON = json.JSONEncoder(ensure_ascii=False, default=str)


Stage = TypeVar("Stage", bound=Callable[..., Any])


def given_arrays(run: Stage) -> Stage:
    """Marks the function of a stage that is given its inputs as `LabelledArrays`, not as datasets of xarray."""
    setattr(run, ARRAYS, True)
    return run


@dataclass(frozen=True, eq=False)
class Task:
    """What to run, with what, and where its files are shown.

    stage: name of the stage and of its folder in the cache.
    part: the body (or figure) it is about; empty when the stage has one artifact per scene.
    run: ``"module:function"``, called as ``run(params, inputs, progress)``; see `execute`.
    params: all that its result may depend on, as JSON, next to `inputs` and `files`.
    files: every file that it opens, by the name that users know it by: its content counts, its path does not.
    context: what the function is given as well, and its result must not show: where files lie, names for messages.
    inputs: tasks whose artifact ``nc`` it is given, by name.
    modules: modules that it reaches by a name in `params`, next to those it imports.
    met: modules that it reaches only if it meets what they are for (`encounters`), by the name of that.
    folder: where its files are shown, below the results folder; empty: nowhere.
    names: file of the artifact -> name shown there; a file that is not listed keeps its name.
    exclusive: whether nothing else may run next to it (measurements of time).
    """

    stage: str
    scene: str
    run: str
    params: Mapping[str, Any]
    folder: str = ""
    part: str = ""
    inputs: Mapping[str, Task] = field(default_factory=dict)
    modules: tuple[str, ...] = ()
    met: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    exclusive: bool = False
    context: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Path] = field(default_factory=dict)

    def roots(self, met: Iterable[str] | None = None) -> tuple[str, ...]:
        """Modules by which it reaches all others, if it meets what is named, or by default all that it may."""
        names = self.met if met is None else met
        return (self.run.partition(":")[0], *self.modules, *(module for name in names for module in self.met[name]))

    @property
    def label(self) -> str:
        """Name within the scene, e.g. ``mesh rod1``."""
        return f"{self.stage} {self.part}".strip()


def in_order(tasks: list[Task]) -> list[Task]:
    """`tasks` and all their inputs, each once, inputs first."""
    ordered: dict[Task, None] = {}

    def visit(task: Task) -> None:
        for above in task.inputs.values():
            visit(above)
        ordered.setdefault(task)

    for task in tasks:
        visit(task)
    return list(ordered)


def facts(task: Task, digests: Mapping[str, str], sources: Sources, met: Iterable[str] | None = None) -> dict[str, str]:
    """Everything that decides the artifact, in words: kind and name -> value.

    digests: digest of each input that is known; leave one out to compare the rest.  met: names in `Task.met` of what
    was met; all by default.
    """
    result = {f"parameter {name}": value for name, value in flatten(task.params)}
    result |= {f"input {name}": digest for name, digest in digests.items()}
    result |= contents(task)
    result |= sources.code((*task.roots(met), STORE))
    return {**result, "function": task.run}


def contents(task: Task) -> dict[str, str]:
    """The facts of the files that a task opens, as they are now."""
    return {f"file {name}": _digest(path) for name, path in sorted(task.files.items())}


def _digest(path: Path) -> str:
    """The sha256 of a file; of what is not there, or no file, a word instead: its reader refuses it."""
    try:
        return digest_of(path)
    except (OSError, ValueError):
        return "absent"


def key(task_facts: Mapping[str, str]) -> str:
    """Name of the artifact in the cache: sha256 of the facts, 32 hexadecimal digits."""
    text = json.dumps(task_facts, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def flatten(node: Any, where: str = "") -> list[tuple[str, str]]:
    """Dotted path -> canonical text of every leaf of a JSON tree; floats by repr.

    Empty tables and lists are leaves, so that adding an empty one is seen. What JSON cannot say (a
    date or a nan that somebody wrote into a recipe) is stored as text; the stage will refuse it.
    """
    if isinstance(node, Mapping) and node:
        below = [(str(name), value) for name, value in node.items()]
    elif isinstance(node, (list, tuple)) and any(isinstance(x, (dict, list, tuple, Mapping)) for x in node):
        below = [(str(number), value) for number, value in enumerate(node)]
    else:
        return [(where, _JSON.encode(node))]
    return [leaf for name, value in below for leaf in flatten(value, f"{where}.{name}" if where else name.lstrip("."))]


def reasons(new: Mapping[str, str], last: Mapping[str, str] | None, unknown: frozenset[str] = frozenset()) -> list[str]:
    """Why to run again, in words; empty when nothing changed.

    last: facts of the artifact made last, None when there is none.
    unknown: inputs (by name) that will themselves be made again; they are not compared.
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
