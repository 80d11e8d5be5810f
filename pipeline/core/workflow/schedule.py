"""Brings tasks up to date over the cores there are: fresh ones are recognised, stale ones run as soon as
their inputs are there."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.pipeline.core.artifacts.store import MAIN, Record, Store
from flexclear.pipeline.core.system.errors import INTERRUPTED, FlexclearError, ResourceError, StoppedError
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.core.workflow import cores, stopping, workers
from flexclear.pipeline.core.workflow.execute import execute, find, key_of
from flexclear.pipeline.core.workflow.fingerprint import Sources, sources_of
from flexclear.pipeline.core.workflow.progress import Monitor
from flexclear.pipeline.core.workflow.task import Task, in_order

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

#: noted next to what is shown until it has been brought up to date
UNFINISHED = "making it again was begun and not finished"
#: how often the progress of workers is examined [s]
TICK = 0.2
#: workers that are asked to stop have so long for it [s]; a step of 20 000 evaluations, and writing what there is
GRACE = 60.0


@dataclass(frozen=True, slots=True)
class Failure:
    """A task that could not be done: the exit code and what the user reads."""

    task: Task
    exit_code: int
    message: str


@dataclass(frozen=True)
class Outcome:
    """What became of the tasks asked for: the records of those that are up to date, and the failures."""

    records: Mapping[Task, Record]
    failures: tuple[Failure, ...]


@dataclass(frozen=True, slots=True)
class _Running:
    """A task in a worker: its key, since the same artifact is not asked for twice, and its name on the screen."""

    task: Task
    key: str
    name: str


@dataclass
class _Plan:
    """Book-keeping of one call: what is done, what failed, what still waits."""

    waiting: list[Task]
    tasks: tuple[Task, ...]
    done: dict[Task, Record] = field(default_factory=dict)
    failed: dict[Task, Failure] = field(default_factory=dict)

    def inputs(self, task: Task) -> dict[str, Record]:
        return {name: self.done[above] for name, above in task.inputs.items()}

    def ready(self) -> list[Task]:
        return [t for t in self.waiting if all(above in self.done for above in t.inputs.values())]

    def give_up_below_failures(self) -> None:
        """Tasks whose inputs failed are left out silently; the failure itself is reported."""
        for task in list(self.waiting):
            broken = next((self.failed[a] for a in task.inputs.values() if a in self.failed), None)
            if broken is not None:
                self.failed[task] = broken
                self.waiting.remove(task)


def bring(tasks: list[Task], store: Store, sources: Sources, monitor: Monitor, jobs: int | None = None) -> Outcome:
    """Bring tasks and all their inputs up to date; a failure stops only what depends on it.

    jobs: processes at most; default: the cores this process may use.  When it is asked to stop (`stopping`), works
    that can leave what there is do so, and are among the failures; after Ctrl-C it then raises KeyboardInterrupt.
    """
    store.sweep()
    plan = _Plan(in_order(tasks), tuple(in_order(tasks)))
    _settle_fresh(plan, store, sources)
    if plan.waiting:
        for task in plan.waiting:
            if store.last(task.folder, task.label) is not None:
                store.outdated(task.folder, task.label, UNFINISHED)
        monitor.start(len(plan.waiting))
        width = min(jobs or cores.cores(), _width(plan.waiting))
        with stopping.gently(monitor.say):
            if width == 1:
                _alone(plan, store, sources, monitor)
            else:
                _together(plan, store, sources, monitor, width)
        monitor.end()
        for task in plan.tasks:
            if task in plan.failed:
                store.outdated(task.folder, task.label, plan.failed[task].message)
    failures = tuple(dict.fromkeys(plan.failed.values()))
    if any(failure.exit_code == INTERRUPTED for failure in failures):
        for failure in failures:
            monitor.say(failure.message)
        raise KeyboardInterrupt
    return Outcome(plan.done, failures)


def _width(tasks: list[Task]) -> int:
    """How many tasks can run side by side at most: chains, counted by what nothing waits for."""
    return max(1, len({(t.scene, t.part) for t in tasks if not t.exclusive}))


def _settle_fresh(plan: _Plan, store: Store, sources: Sources) -> None:
    """Tasks are in order, so one pass finds all that is fresh."""
    for task in list(plan.waiting):
        if all(above in plan.done for above in task.inputs.values()):
            record = find(task, plan.inputs(task), store, sources)
            if record is not None:
                plan.done[task] = record
                plan.waiting.remove(task)


def _alone(plan: _Plan, store: Store, sources: Sources, monitor: Monitor) -> None:
    """One after the other in this process."""
    while ready := plan.ready():
        why = stopping.requested()
        if why:
            _leave_waiting(plan, why)
            return
        task = ready[0]
        plan.waiting.remove(task)
        name = monitor.begin(task.scene, task.label)
        result = attempt(task, plan.inputs(task), store, sources, partial(monitor.update, name))
        _note(plan, task, result)
        monitor.finish(name, failed=isinstance(result, Failure))
        plan.give_up_below_failures()


def _together(plan: _Plan, store: Store, sources: Sources, monitor: Monitor, width: int) -> None:
    """In worker processes."""
    running: dict[Future[Record | Failure], _Running] = {}
    with workers.team(width) as team, stopping.heeded():
        while (plan.waiting or running) and not stopping.requested():
            _submit(plan, running, team.pool, width, store, sources, monitor)
            _collect(plan, running, monitor)
            _relay(team.channel, monitor)
        if stopping.requested():
            _end_in_good_order(plan, running, team.channel, monitor)


def _end_in_good_order(
    plan: _Plan, running: dict[Future[Record | Failure], _Running], channel: workers.Channel, monitor: Monitor
) -> None:
    """Ask the workers to stop, and wait for what they leave: not for those that cannot leave anything, nor for ever."""
    from concurrent.futures import wait

    why, end = stopping.requested(), time.monotonic() + GRACE
    channel.request_stop(why)
    while time.monotonic() < end:
        _, late = wait(running, timeout=TICK)
        if len(late) <= channel.deaf.value:
            break
        _relay(channel, monitor)
    for future, job in running.items():
        if future.done() and future.exception() is None:
            result = future.result()
            _note(plan, job.task, result)
            monitor.finish(job.name, failed=isinstance(result, Failure))
        else:
            plan.waiting.append(job.task)
    running.clear()
    _leave_waiting(plan, why)


def _leave_waiting(plan: _Plan, why: str) -> None:
    """Abandon all unfinished tasks when the command must stop; that is reported once."""
    if plan.waiting:
        code = StoppedError(why, interrupted=why == stopping.INTERRUPTED).exit_code
        rest = Failure(plan.waiting[0], code, f"{len(plan.waiting)} of {len(plan.tasks)} tasks are left undone: {why}")
        plan.failed |= {task: rest for task in plan.waiting}
        plan.waiting.clear()


def _submit(
    plan: _Plan,
    running: dict[Future[Record | Failure], _Running],
    pool: ProcessPoolExecutor,
    width: int,
    store: Store,
    sources: Sources,
    monitor: Monitor,
) -> None:
    """Hand out ready tasks while workers are free; an exclusive one only to an idle pool.

    Tasks whose artifact is being made already wait for it; those whose artifact is there by now,
    made for another scene, are done.
    """
    others_idle = not running and len(plan.ready()) == 1
    for task in sorted(plan.ready(), key=lambda t: t.exclusive):
        alone = any(other.task.exclusive for other in running.values())
        if len(running) >= width or alone or (task.exclusive and running):
            return
        inputs = plan.inputs(task)
        key = key_of(task, inputs, sources)
        if any(other.key == key for other in running.values()):
            continue
        plan.waiting.remove(task)
        name = monitor.begin(task.scene, task.label)
        record = find(task, inputs, store, sources)
        if record is not None:
            _note(plan, task, record)
            monitor.finish(name, failed=False)
            continue
        where = (store.root, sources.root, sources.memo)
        with workers.lost(), workers.without_main():  # an idle one; a script without a guard is not run again
            future = pool.submit(_work, task, inputs, name, where, others_idle)
        running[future] = _Running(task, key, name)


def _collect(plan: _Plan, running: dict[Future[Record | Failure], _Running], monitor: Monitor) -> None:
    from concurrent.futures import FIRST_COMPLETED, wait
    from concurrent.futures.process import BrokenProcessPool

    done, _ = wait(running, timeout=TICK, return_when=FIRST_COMPLETED)
    for future in done:
        job = running.pop(future)
        task, name = job.task, job.name
        try:
            result = future.result()
        except BrokenProcessPool:
            if stopping.requested():  # one that had just been started is not deaf to Ctrl-C yet
                plan.waiting.append(task)
                continue
            text = f"{task.scene} {task.label}: a worker process was killed; is the memory full?"
            raise ResourceError(text) from None
        _note(plan, task, result)
        monitor.finish(name, failed=isinstance(result, Failure))
    plan.give_up_below_failures()


def _relay(channel: workers.Channel, monitor: Monitor) -> None:
    for news in channel.received():
        monitor.update(*news)


def _note(plan: _Plan, task: Task, result: Record | Failure) -> None:
    if isinstance(result, Failure):
        plan.failed[task] = replace(result, task=task)  # a worker has a copy of it
    else:
        plan.done[task] = result


def _work(
    task: Task,
    inputs: Mapping[str, Record],
    name: str,
    where: tuple[Path, Path, Path | None],
    others_idle: bool,
) -> Record | Failure:
    """In a worker: the same as in `_alone`, with progress sent home, as often as it is read there."""
    root, source, memo = where
    cores.set_idle(others_idle)
    last = 0.0

    def progress(fraction: float | None, text: str) -> None:
        nonlocal last
        if fraction is None or time.monotonic() - last > TICK:
            last = time.monotonic()
            workers.report(name, fraction, text)

    with stopping.busy():
        return attempt(task, inputs, Store(root, say=partial(progress, None)), sources_of(source, memo), progress)


def attempt(
    task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources, progress: Progress
) -> Record | Failure:
    """The record, or the failure with what the user sees. A mistake of this program is reported with
    its traceback, since only that helps then."""
    try:
        return execute(task, inputs, store, sources, progress)
    except StoppedError as stopped:
        code, text = stopped.exit_code, _left(task, stopped, store)
    except FlexclearError as error:
        code, text = error.exit_code, str(error)
    except MemoryError:
        code, text = ResourceError.exit_code, "the memory is full"
    except Exception:
        code, text = 1, f"unexpected error, please report it\n{traceback.format_exc()}"
    return Failure(task, code, f"{task.scene} {task.label}: {text}")


def _left(task: Task, stopped: StoppedError, store: Store) -> str:
    """Message about a task that was stopped, and what there is of it."""
    time = getattr(stopped.partial, "attrs", {}).get("stopped_at")
    if time is None:  # it is of a part of the work, such as a member of an ensemble, and no dataset
        return f"{stopped}; run it again, and what is finished of it is not computed again"
    path = store.show_partial(stopped.partial, task.folder, task.names.get(MAIN, MAIN))
    there = (
        f"; what there is, up to t = {time:.6g} s, is in {path} (attribute complete = 0)" if path is not None else ""
    )
    return f"{stopped}; run it again{there}"
