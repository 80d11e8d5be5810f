"""Execution of one task in this process, unless its artifact is up to date; and the state of tasks, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module

from flexclear.artifacts.store import Record, Store
from flexclear.system import machine, threads
from flexclear.system.errors import ResourceError
from flexclear.system.progress import Progress
from flexclear.workflow import journal
from flexclear.workflow.fingerprint import Sources
from flexclear.workflow.task import ARRAYS, Task, contents, facts, in_order, key, reasons


@dataclass(frozen=True)
class State:
    """State of a task. record: its artifact when up to date. why: otherwise the reasons to run it, in words."""

    task: Task
    record: Record | None
    why: tuple[str, ...]


def key_of(task: Task, inputs: Mapping[str, Record], sources: Sources) -> str:
    """Return the key of the artifact that a task produces from these inputs and from its current files."""
    return key(_facts(task, inputs, sources))


def find(task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources) -> Record | None:
    """Show an up-to-date artifact in its task's folder and return its record; None when there is none."""
    record = _find_stored(task, inputs, store, sources)
    if record is not None:
        store.show(record, task.folder, task.names, task.label)
    return record


def execute(task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources, progress: Progress) -> Record:
    """Return the artifact of a task with up-to-date inputs, and run the task if necessary (once over all processes).

    Raises ResourceError when a file of the task changes during the run.
    """
    known = _facts(task, inputs, sources)
    name = key(known)
    with store.lock(task.stage, name, lambda: progress(None, "waiting for another process with the same task")):
        record = _find_stored(
            task, inputs, Store(store.root), sources
        )  # silent store: `find` has reported faults already
        if record is None:
            module, _, function = task.run.partition(":")
            run = getattr(import_module(module), function)
            load = store.arrays if hasattr(run, ARRAYS) else store.load
            data = {role: load(above) for role, above in inputs.items()}
            begun = store.path(task.stage, name, "part")
            with threads.limit_to_one(), journal.keep_journal(begun.parent, begun.stem) as storage:
                product = run({**task.params, **task.context}, data, progress)
            changed = [fact for fact, value in contents(task).items() if known[fact] != value]
            if changed:
                raise ResourceError(f"{changed[0]} changed while it was read; run again")
            record = store.put(task.stage, name, product, known, machine.instruction_set())
            storage.remove()
    store.show(record, task.folder, task.names, task.label)
    return record


def states(tasks: list[Task], store: Store, sources: Sources) -> list[State]:
    """Return the state of each task and of all inputs, inputs first; run nothing."""
    states_of: dict[Task, State] = {}
    for task in in_order(tasks):
        above = {name: states_of[t].record for name, t in task.inputs.items()}
        fresh = {name: record for name, record in above.items() if record is not None}
        stale = frozenset(above.keys() - fresh.keys())
        states_of[task] = _state(task, fresh, stale, store, sources)
    return list(states_of.values())


def _state(task: Task, fresh: Mapping[str, Record], stale: frozenset[str], store: Store, sources: Sources) -> State:
    last = store.last_shown(task.folder, task.label)
    now = _facts(task, fresh, sources)
    if last is None and stale:
        return State(task, None, ("never run",))
    above = [f"its input {name} would be computed again" for name in sorted(stale)]
    if not stale:
        record = _find_stored(task, fresh, store, sources)
        if record is not None:
            return State(task, record, ())
    why = reasons(now, None if last is None else last.facts, stale) + above
    if not why and last is not None:
        # nothing changed, so the artifact itself must be damaged; `find` has reported this if it is corrupt
        why = [store.fault(last) or "its record in the cache is missing"]
    failure = store.why_outdated(task.folder, task.label)
    if failure is not None:
        why.append(f"the shown results are outdated: {failure.splitlines()[0]}")
    return State(task, None, tuple(why))


def _find_stored(task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources) -> Record | None:
    return store.find(task.stage, key_of(task, inputs, sources))


def _facts(task: Task, inputs: Mapping[str, Record], sources: Sources) -> dict[str, str]:
    return facts(task, {name: record.digest for name, record in inputs.items()}, sources)
