"""The scheduler: brings tasks up to date on the available cores. Fresh tasks are recognised; stale ones run as soon as
their inputs are available."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from flexclear.artifacts.store import MAIN, Record, Store
from flexclear.scene import toml_files
from flexclear.system.errors import (
    INTERRUPTED,
    FlexclearError,
    InputError,
    ResourceError,
    StoppedError,
    errors_of,
)
from flexclear.system.progress import Progress
from flexclear.workflow import cores, stopping, workers
from flexclear.workflow.execute import execute, find, key_of
from flexclear.workflow.fingerprint import Sources, sources_of
from flexclear.workflow.progress import Monitor
from flexclear.workflow.task import PATH, Task, in_order

if TYPE_CHECKING:
    from concurrent.futures import Future, ProcessPoolExecutor

#: note next to shown results until they are up to date
UNFINISHED = "an update was started and not finished"
#: interval at which the progress of workers is examined [s]
TICK = 0.2
#: time for workers to stop [s]: enough for a step of 20 000 evaluations and for writing the partial results
GRACE = 60.0


@dataclass(frozen=True, slots=True)
class Failure:
    """A failed task: the exit code and the message to the user."""

    task: Task
    exit_code: int
    message: str


@dataclass(frozen=True)
class Outcome:
    """Outcome of the requested tasks: the records of those that are up to date, and the failures."""

    records: Mapping[Task, Record]
    failures: tuple[Failure, ...]


@dataclass(frozen=True, slots=True)
class _Running:
    """A task in a worker: its key, so that the same artifact is not requested twice, and its name on the screen."""

    task: Task
    key: str
    name: str


@dataclass
class _Plan:
    """State of one call of `bring_up_to_date`: finished, failed and waiting tasks."""

    waiting: list[Task]
    tasks: tuple[Task, ...]
    done: dict[Task, Record] = field(default_factory=dict)
    failed: dict[Task, Failure] = field(default_factory=dict)

    def inputs(self, task: Task) -> dict[str, Record]:
        return {name: self.done[above] for name, above in task.inputs.items()}

    def ready(self) -> list[Task]:
        return [t for t in self.waiting if all(above in self.done for above in t.inputs.values())]

    def give_up_below_failures(self) -> None:
        """Drop tasks whose inputs failed, without a report of their own; the failure itself is reported."""
        for task in list(self.waiting):
            broken = next((self.failed[a] for a in task.inputs.values() if a in self.failed), None)
            if broken is not None:
                self.failed[task] = broken
                self.waiting.remove(task)


def bring_up_to_date(
    tasks: list[Task], store: Store, sources: Sources, monitor: Monitor, jobs: int | None = None
) -> Outcome:
    """Bring tasks and all their inputs up to date; a failure stops only the tasks that depend on it.

    jobs: largest number of processes; default: the cores this process may use. On a request to stop (`stopping`), tasks
    that can leave partial results do so, and count as failures; after Ctrl-C, KeyboardInterrupt follows.
    """
    store.remove_leftovers()
    plan = _Plan(in_order(tasks), tuple(in_order(tasks)))
    _settle_fresh(plan, store, sources)
    if plan.waiting:
        _fail_wrong(plan)
        for task in plan.waiting:
            if store.last_shown(task.folder, task.label) is not None:
                store.mark_outdated(task.folder, task.label, UNFINISHED)
        monitor.start(len(plan.waiting))
        width = min(jobs or cores.count_cores(), _largest_concurrency(plan.waiting))
        with stopping.request_at_interrupt(monitor.say):
            if width == 1:
                _run_here(plan, store, sources, monitor)
            else:
                _run_in_workers(plan, store, sources, monitor, width)
        monitor.end()
        for task in plan.tasks:
            if task in plan.failed:
                store.mark_outdated(task.folder, task.label, plan.failed[task].message)
    failures = tuple(dict.fromkeys(plan.failed.values()))
    if any(failure.exit_code == INTERRUPTED for failure in failures):
        for failure in failures:
            monitor.say(failure.message)
        raise KeyboardInterrupt
    return Outcome(plan.done, failures)


def _largest_concurrency(tasks: list[Task]) -> int:
    """Return how many tasks can run concurrently at most: one per scene and part, exclusive tasks excluded."""
    return max(1, len({(t.scene, t.part) for t in tasks if not t.exclusive}))


def _settle_fresh(plan: _Plan, store: Store, sources: Sources) -> None:
    """Mark all fresh tasks as done; tasks are in order of dependence, so one pass suffices."""
    for task in list(plan.waiting):
        if all(above in plan.done for above in task.inputs.values()):
            record = find(task, plan.inputs(task), store, sources)
            if record is not None:
                plan.done[task] = record
                plan.waiting.remove(task)


def _fail_wrong(plan: _Plan) -> None:
    """Fail the waiting tasks whose check raises, all that depend on them, and all that only these need."""
    for task in list(plan.waiting):
        module, _, function = task.check.partition(":")
        try:
            if module:
                getattr(import_module(module), function)(task.params)
        except InputError as error:
            plan.waiting.remove(task)
            plan.failed[task] = _failure(task, error)
    plan.give_up_below_failures()
    for task in reversed(plan.waiting if plan.failed else []):
        users = [other for other in plan.tasks if task in other.inputs.values()]
        if users and all(other in plan.failed for other in users):
            plan.failed[task] = plan.failed[users[0]]
            plan.waiting.remove(task)


def _run_here(plan: _Plan, store: Store, sources: Sources, monitor: Monitor) -> None:
    """Run the tasks one after the other in this process."""
    while ready := plan.ready():
        why = stopping.stop_reason()
        if why:
            _leave_waiting(plan, why)
            return
        task = ready[0]
        plan.waiting.remove(task)
        name = monitor.begin(task.scene, task.label)
        result = attempt_task(task, plan.inputs(task), store, sources, partial(monitor.update, name))
        _store_result(plan, task, result)
        monitor.finish(name, failed=isinstance(result, Failure))
        plan.give_up_below_failures()


def _run_in_workers(plan: _Plan, store: Store, sources: Sources, monitor: Monitor, width: int) -> None:
    """Run the tasks in worker processes."""
    running: dict[Future[Record | Failure], _Running] = {}
    with workers.worker_team(width) as team, stopping.heed_requests():
        while (plan.waiting or running) and not stopping.stop_reason():
            _submit(plan, running, team.pool, width, store, sources, monitor)
            _collect(plan, running, monitor)
            _relay_reports(team.channel, monitor)
        if stopping.stop_reason():
            _end_in_good_order(plan, running, team.channel, monitor)


def _end_in_good_order(
    plan: _Plan, running: dict[Future[Record | Failure], _Running], channel: workers.Channel, monitor: Monitor
) -> None:
    """Ask the workers to stop, and wait up to GRACE for their partial results, without those that cannot leave any."""
    from concurrent.futures import wait

    why, end = stopping.stop_reason(), time.monotonic() + GRACE
    channel.request_stop(why)
    while time.monotonic() < end:
        _, late = wait(running, timeout=TICK)
        if len(late) <= channel.unstoppable.value:
            break
        _relay_reports(channel, monitor)
    for future, job in running.items():
        if future.done() and future.exception() is None:
            result = future.result()
            _store_result(plan, job.task, result)
            monitor.finish(job.name, failed=isinstance(result, Failure))
        else:
            plan.waiting.append(job.task)
    running.clear()
    _leave_waiting(plan, why)


def _leave_waiting(plan: _Plan, why: str) -> None:
    """Abandon all unfinished tasks when the command must stop, and report this once."""
    if plan.waiting:
        code = stopping.stopping_error(why).exit_code
        rest = Failure(plan.waiting[0], code, f"{len(plan.waiting)} of {len(plan.tasks)} tasks were not run: {why}")
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
    """Submit ready tasks while workers are free; an exclusive task only to an idle pool.

    A task whose artifact is being produced by another task waits for it; a task whose artifact exists by now, produced
    for another scene, is done.
    """
    others_idle = not running and len(plan.ready()) == 1
    for task in sorted(plan.ready(), key=lambda t: t.exclusive):
        exclusive_running = any(other.task.exclusive for other in running.values())
        if len(running) >= width or exclusive_running or (task.exclusive and running):
            return
        inputs = plan.inputs(task)
        key = key_of(task, inputs, sources)
        if any(other.key == key for other in running.values()):
            continue
        plan.waiting.remove(task)
        name = monitor.begin(task.scene, task.label)
        record = find(task, inputs, store, sources)
        if record is not None:
            _store_result(plan, task, record)
            monitor.finish(name, failed=False)
            continue
        where = (store.root, sources.root, sources.memo)
        with workers.report_lost_worker():  # an idle worker may die
            future = pool.submit(_run_in_worker, task, inputs, name, where, others_idle)
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
            if stopping.stop_reason():  # Ctrl-C ends a worker that has just started and does not ignore it yet
                plan.waiting.append(task)
                continue
            raise ResourceError(f"{task.scene} {task.label}: {workers.LOST}") from None
        _store_result(plan, task, result)
        monitor.finish(name, failed=isinstance(result, Failure))
    plan.give_up_below_failures()


def _relay_reports(channel: workers.Channel, monitor: Monitor) -> None:
    for news in channel.take_reports():
        monitor.update(*news)


def _store_result(plan: _Plan, task: Task, result: Record | Failure) -> None:
    if isinstance(result, Failure):
        plan.failed[task] = replace(result, task=task)  # the worker's result holds a copy of the task
    else:
        plan.done[task] = result


def _run_in_worker(
    task: Task,
    inputs: Mapping[str, Record],
    name: str,
    where: tuple[Path, Path, Path | None],
    others_idle: bool,
) -> Record | Failure:
    """Run a task in a worker as `_run_here` does; report progress to the parent as often as the parent reads it."""
    root, source, memo = where
    cores.set_idle(others_idle)
    last = 0.0

    def progress(fraction: float | None, text: str) -> None:
        nonlocal last
        if fraction is None or time.monotonic() - last > TICK:
            last = time.monotonic()
            workers.report(name, fraction, text)

    with stopping.declare_task():
        return attempt_task(task, inputs, Store(root, say=partial(progress, None)), sources_of(source, memo), progress)


def attempt_task(
    task: Task, inputs: Mapping[str, Record], store: Store, sources: Sources, progress: Progress
) -> Record | Failure:
    """Return the record, or the failure with its message to the user. Unexpected errors are reported with their
    traceback, since only that helps to find their cause."""
    try:
        return execute(task, inputs, store, sources, progress)
    except StoppedError as stopped:
        code, text = stopped.exit_code, _stopped_message(task, stopped, store)
    except FlexclearError as error:
        return _failure(task, error)
    except MemoryError:
        code, text = ResourceError.exit_code, "the memory is full"
    except Exception:
        code, text = 1, f"unexpected error; please report it\n{traceback.format_exc()}"
    return Failure(task, code, f"{task.scene} {task.label}: {text}")


def _failure(task: Task, error: FlexclearError) -> Failure:
    """Return the failure of a task by an expected error; input errors are located in their file, if any."""
    if isinstance(error, InputError):
        path = task.context.get(PATH)
        error = toml_files.with_line_number(toml_files.with_file_name(error, Path(path) if path else None))
        if path and all(str(path) in one.place for one in errors_of(error)):
            return Failure(task, error.exit_code, str(error))
    return Failure(task, error.exit_code, f"{task.scene} {task.label}: {error}")


def _stopped_message(task: Task, stopped: StoppedError, store: Store) -> str:
    """Return the message about a stopped task, and write its partial result, if any, next to the shown files."""
    if stopped.partial is None:
        return f"{stopped}; run it again: finished parts are not computed again"
    path = store.show_partial(stopped.partial, task.folder, task.names.get(MAIN, MAIN))
    until = f"; the partial result up to t = {stopped.partial.attrs['stopped_at']:.6g} s is in"
    return f"{stopped}; run it again" + ("" if path is None else f"{until} {path} (attribute complete = 0)")
