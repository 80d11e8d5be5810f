"""One task in this process: fresh, or run and stored. And the state of a task, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module

from flexclear.pipeline.core.artifacts.store import Record, Store
from flexclear.pipeline.core.system import file_dependencies, machine, threads
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.core.workflow import journal
from flexclear.pipeline.core.workflow.fingerprint import Sources
from flexclear.pipeline.core.workflow.task import ARRAYS, Task, facts, in_order, key, reasons


@dataclass(frozen=True)
class State:
    """Where a task is. record: its artifact, when it is fresh. why: else the reasons, in words."""

    task: Task
    record: Record | None
    why: tuple[str, ...]


def key_of(task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources) -> str:
    """Key of the artifact that a task makes from these inputs and from the files that it opens, as they are now.

    Which files these are is known since it was made for the first time; before, there is nothing under any key.
    """
    return _with_files(task, _facts(task, inputs, sources), store)[1]


def find(task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources) -> Record | None:
    """The fresh artifact of a task whose inputs are fresh, now also shown in its folder; or None."""
    record = store.find(task.stage, key_of(task, inputs, store, sources))
    if record is not None:
        store.show(record, task.folder, task.names, task.label)
    return record


def execute(task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources, progress: Progress) -> Record:
    """The artifact of a task whose inputs are fresh, run if need be (once, over all processes)."""
    known = _facts(task, inputs, sources)
    plain = key(known)
    with store.lock(task.stage, plain, lambda: progress(None, "waiting for another process that makes the same")):
        # whoever requested the task has reported its faults
        record = Store(store.root).find(task.stage, _with_files(task, known, store)[1])
        if record is None:
            module, _, function = task.run.partition(":")
            run = getattr(import_module(module), function)
            load = store.arrays if hasattr(run, ARRAYS) else store.load
            data = {name: load(above) for name, above in inputs.items()}
            begun = store.path(task.stage, _with_files(task, known, store)[1], "part")
            with (
                threads.one(),
                journal.storage(begun.parent, begun.stem) as storage,
                file_dependencies.watched(task.base) as read,
            ):
                product = run({**task.params, **task.context}, data, progress)
            known |= _noted(task, plain, read, store)
            record = store.put(task.stage, key(known), product, known, machine.instruction_set())
            storage.remove()
    store.show(record, task.folder, task.names, task.label)
    return record


def states(tasks: list[Task], store: Store, sources: Sources) -> list[State]:
    """State of each task and all its inputs, inputs first; nothing is run."""
    states_of: dict[Task, State] = {}
    for task in in_order(tasks):
        above = {name: states_of[t].record for name, t in task.inputs.items()}
        fresh = {name: record for name, record in above.items() if record is not None}
        stale = frozenset(above.keys() - fresh.keys())
        states_of[task] = _state(task, fresh, stale, store, sources)
    return list(states_of.values())


def _state(task: Task, fresh: Mapping[str, Record], stale: frozenset[str], store: Store, sources: Sources) -> State:
    now, name = _with_files(task, _facts(task, fresh, sources), store)
    last = store.last(task.folder, task.label)
    if last is None and stale:
        return State(task, None, ("never run",))
    above = [f"its input {name} would be made again" for name in sorted(stale)]
    if not stale:
        record = store.find(task.stage, name)
        if record is not None:
            return State(task, record, ())
    why = reasons(now, None if last is None else last.facts, stale) + above
    if not why and last is not None:
        # nothing changed, so the artifact itself must be broken; `find` has said so if it is corrupt
        why = [store.fault(last) or "its record in the cache is missing"]
    failure = store.why_outdated(task.folder, task.label)
    if failure is not None:
        why.append(f"what is shown is of an earlier state: {failure.splitlines()[0]}")
    return State(task, None, tuple(why))


def _facts(task: Task, inputs: Mapping[str, Record], sources: Sources) -> dict[str, str]:
    return facts(task, {name: record.digest for name, record in inputs.items()}, sources)


def _with_files(task: Task, known: Mapping[str, str], store: Store) -> tuple[Mapping[str, str], str]:
    """Facts with those of the files that the task has ever read when all else was as it is, and their key."""
    plain = key(known)
    names = store.names(task.stage, plain)
    if not names:
        return known, plain
    whole = {**known, **file_dependencies.facts(file_dependencies.digests(names, task.base))}
    return whole, key(whole)


def _noted(task: Task, plain: str, read: Mapping[str, str], store: Store) -> dict[str, str]:
    """Facts of the files that were read now, and of others that once were; their names are stored for the next
    time."""
    names = set(store.names(task.stage, plain))
    if not names >= read.keys():
        store.keep_names(task.stage, plain, sorted(names | read.keys()))
    return file_dependencies.facts(file_dependencies.digests(names - read.keys(), task.base) | dict(read))
