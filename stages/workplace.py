"""Where commands work: arguments that all of them take, the store, the sources, whom it reports to; bringing tasks up
to date.

No scene is read here, so that a command that finds all of its results as they were does not import what reads them.
"""

from __future__ import annotations

import argparse
import math
import re
import time
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.artifacts.paths import TREE, results_root
from flexclear.pipeline.core.artifacts.store import Record, Store
from flexclear.pipeline.core.scene.units import quantity
from flexclear.pipeline.core.system.errors import FlexclearError, InputError
from flexclear.pipeline.core.system.log import set_level
from flexclear.pipeline.core.workflow import stopping
from flexclear.pipeline.core.workflow.fingerprint import Sources, sources_of
from flexclear.pipeline.core.workflow.progress import Monitor
from flexclear.pipeline.core.workflow.schedule import Failure, Outcome, bring
from flexclear.pipeline.core.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

#: options that mean the same on every command: how argparse adds each
OPTIONS: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "set": (
        ("--set",),
        {
            "action": "append",
            "default": [],
            "metavar": "KEY=VALUE",
            "help": "change a value, such as joint.A1.clearance='0.2 mm'; may be given several times",
        },
    ),
    "jobs": (("--jobs",), {"type": int, "metavar": "N", "help": "processes at most; default: one for each core"}),
    "limit": (
        ("--limit",),
        {
            "metavar": "TIME",
            "help": "stop in good order after, e.g., 2h (exit code 4); what is finished is not computed again",
        },
    ),
    "budget": (("--budget",), {"metavar": "TIME", "help": "processor time for trial runs, such as 10s, 2min or 1h"}),
    "json": (("--json",), {"action": "store_true", "help": "print the results as JSON"}),
    "quiet": (("-q", "--quiet"), {"action": "store_true", "help": "say nothing but errors, warnings and results"}),
    "verbose": (("-v", "--verbose"), {"action": "store_true", "help": "keep every line of progress, with times"}),
}


def add_options(parser: argparse.ArgumentParser, *names: str, **changed: Any) -> None:
    """Add options of `OPTIONS` by name; "said" adds quiet and verbose, "usual" what all commands take that compute.

    changed: by name, keys of argparse that differ on this command, as its default.
    """
    for name in names:
        if name == "usual":
            add_options(parser, "set", "jobs", "limit", "said", **changed)
        elif name == "said":
            said = parser.add_mutually_exclusive_group()
            for option in ("quiet", "verbose"):
                flags, keys = OPTIONS[option]
                said.add_argument(*flags, **keys)
        else:
            (flags, keys), more = OPTIONS[name], changed.get(name, {})
            text = f"{keys['help']} (default {more['default']})" if "default" in more else keys["help"]
            parser.add_argument(*flags, **keys | more | {"help": text})


def seconds(given: str | float, option: str) -> float:
    """A time above zero [s], as a number or as ``10s`` or ``2min``; InputError for another value of an option."""
    try:
        spaced = re.sub(r"(?<=[0-9.])(?=[a-z])", " ", given.strip()) if isinstance(given, str) else float(given)
        result = quantity(spaced, "time")
        if not result > 0.0:
            raise ValueError("it must be above zero")
    except ValueError as error:
        raise InputError(f"{option} {given}", f"is no time: {error}", f"write {option} 2h, or '90 min'") from None
    return result


def relative(path: Path) -> str:
    """A path as seen from the current folder, where it lies below it."""
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


@dataclass(frozen=True)
class Made:
    """An artifact that is up to date: the task that made it, its record, and the store that holds its files."""

    task: Task
    record: Record
    store: Store

    @property
    def folder(self) -> Path:
        """Where its files are shown."""
        return self.store.root / self.task.folder

    def dataset(self) -> xr.Dataset:
        """Its main file."""
        return self.store.load(self.record)

    def read(self, name: str) -> bytes:
        """One of its files, from the store."""
        return self.store.path(self.task.stage, self.record.key, name).read_bytes()

    def text(self, name: str) -> str:
        """One of its files that are text."""
        return self.read(name).decode()


@dataclass(frozen=True)
class Workplace:
    """Where artifacts are stored, where the source lies, and the monitor of progress.

    end: when the command is to stop, by the monotonic clock [s], and the message printed then.
    """

    store: Store
    sources: Sources
    monitor: Monitor = field(default_factory=Monitor)
    jobs: int | None = None
    end: tuple[float, str] = (math.inf, "")

    def bring(self, tasks: list[Task], jobs: int | None = None) -> Outcome:
        """Bring tasks up to date, in so many processes at most; default: this workplace's, else the cores there are."""
        with self.limited():
            return bring(tasks, self.store, self.sources, self.monitor, jobs or self.jobs)

    def artifacts(self, outcome: Outcome) -> dict[Task, Made]:
        """What `bring` made, and what was up to date."""
        return {task: Made(task, record, self.store) for task, record in outcome.records.items()}

    def made(self, *tasks: Task, jobs: int | None = None) -> list[Made]:
        """Artifacts of tasks, brought up to date; FailedTasksError where one of them, or of their inputs, fails."""
        outcome = self.bring(list(tasks), jobs)
        check(outcome)
        there = self.artifacts(outcome)
        return [there[task] for task in tasks]

    def datasets(self, *tasks: Task, jobs: int | None = None) -> list[xr.Dataset]:
        """Main files of what `made` gives."""
        return [one.dataset() for one in self.made(*tasks, jobs=jobs)]

    def limited(self) -> AbstractContextManager[None]:
        """Meanwhile work is to stop when the time is over that the command was given."""
        end, why = self.end
        return stopping.until(None if end == math.inf else end - time.monotonic(), why)


class FailedTasksError(FlexclearError):
    """Some tasks failed; each is reported, and the first decides the exit code."""

    def __init__(self, failures: tuple[Failure, ...]) -> None:
        super().__init__("\n".join(failure.message for failure in failures))
        self.exit_code = failures[0].exit_code


def open_workplace(options: argparse.Namespace | None = None) -> Workplace:
    """The usual one, with results where `results_root` says.

    options: of a command, with `jobs`, its `limit` and how much is said.
    """
    if options is not None:
        set_level(quiet=getattr(options, "quiet", False), verbose=getattr(options, "verbose", False))
    monitor, root = Monitor(), results_root()
    jobs, limit = getattr(options, "jobs", None), getattr(options, "limit", None)
    if jobs is not None and jobs < 1:
        raise InputError("--jobs", f"must be at least 1 (got {jobs})", "leave it out to use every core")
    end = math.inf if limit is None else time.monotonic() + seconds(limit, "--limit")
    sources = sources_of(TREE, root / "cache" / "imports.json")
    why = f"the time that --limit {limit} gives is over"
    return Workplace(Store(root, say=monitor.say), sources, monitor, jobs, (end, why))


def check(outcome: Outcome) -> None:
    """Raise FailedTasksError when something failed."""
    if outcome.failures:
        raise FailedTasksError(outcome.failures)
