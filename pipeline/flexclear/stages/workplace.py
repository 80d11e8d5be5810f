"""The context of commands: common arguments, store, sources, monitor of progress; and bringing tasks up to date.

This module reads no scene, so that a command whose results are fully up to date does not import the code that reads
scenes.
"""

from __future__ import annotations

import argparse
import math
import re
import time
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.artifacts.paths import TREE, results_root
from flexclear.artifacts.store import Record, Store
from flexclear.scene.units import quantity
from flexclear.system.errors import InputError, error_of
from flexclear.system.log import set_level
from flexclear.workflow import stopping, workers
from flexclear.workflow.fingerprint import Sources, sources_of
from flexclear.workflow.progress import Monitor
from flexclear.workflow.schedule import Outcome, bring_up_to_date
from flexclear.workflow.task import Task

if TYPE_CHECKING:
    import xarray as xr

#: options with the same meaning in every command: flags and keys of argparse for each
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
    "jobs": (("--jobs",), {"type": int, "metavar": "N", "help": "number of processes at most (default: one per core)"}),
    "limit": (
        ("--limit",),
        {
            "metavar": "TIME",
            "help": "stop after this time, such as 2h, with exit code 4; finished results are stored",
        },
    ),
    "budget": (("--budget",), {"metavar": "TIME", "help": "processor time for trial runs, such as 10s, 2min or 1h"}),
    "json": (("--json",), {"action": "store_true", "help": "print the results as JSON"}),
    "quiet": (("-q", "--quiet"), {"action": "store_true", "help": "print only errors, warnings and results"}),
    "verbose": (("-v", "--verbose"), {"action": "store_true", "help": "print every line of progress, with times"}),
}


def add_options(parser: argparse.ArgumentParser, *names: str, **changed: Any) -> None:
    """Add options of `OPTIONS` by name; "said" adds quiet and verbose, "usual" those of all commands that compute.

    changed: by name, keys of argparse that differ in this command, as its default.
    """
    for name in names:
        if name == "usual":
            add_options(parser, "set", "jobs", "limit", "said", **changed)
        elif name == "said":
            group = parser.add_mutually_exclusive_group()
            for option in ("quiet", "verbose"):
                flags, keys = OPTIONS[option]
                group.add_argument(*flags, **keys)
        else:
            (flags, keys), more = OPTIONS[name], changed.get(name, {})
            text = f"{keys['help']} (default {more['default']})" if "default" in more else keys["help"]
            parser.add_argument(*flags, **keys | more | {"help": text})


def seconds(given: str | float, option: str) -> float:
    """Return a time above zero [s] from a number or from ``10s`` or ``2min``; raise InputError for other values."""
    try:
        spaced = re.sub(r"(?<=[0-9.])(?=[a-z])", " ", given.strip()) if isinstance(given, str) else float(given)
        result = quantity(spaced, "time")
        if not result > 0.0:
            raise ValueError("it must be above zero")
    except ValueError as error:
        raise InputError(f"{option} {given}", f"is not a time: {error}", f"write {option} 2h, or '90 min'") from None
    return result


def relative(path: Path) -> str:
    """Return a path relative to the current folder when the path is below that folder, else the path as it is."""
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)


@dataclass(frozen=True)
class Made:
    """An artifact that is up to date: the task that produced it, its record, and the store that holds its files."""

    task: Task
    record: Record
    store: Store

    @property
    def folder(self) -> Path:
        """Folder where the artifact's files are shown."""
        return self.store.root / self.task.folder

    def dataset(self) -> xr.Dataset:
        """Load the artifact's main file."""
        return self.store.load(self.record)

    def read(self, name: str) -> bytes:
        """Read one of the artifact's files from the store."""
        return self.store.path(self.task.stage, self.record.key, name).read_bytes()

    def text(self, name: str) -> str:
        """Read one of the artifact's text files."""
        return self.read(name).decode()


@dataclass(frozen=True)
class Workplace:
    """The store of artifacts, the sources, and the monitor of progress.

    end: time at which the command stops, by the monotonic clock [s], and the message printed then.
    """

    store: Store
    sources: Sources
    monitor: Monitor = field(default_factory=Monitor)
    jobs: int | None = None
    end: tuple[float, str] = (math.inf, "")

    def bring(self, tasks: list[Task], jobs: int | None = None) -> Outcome:
        """Bring tasks up to date in at most `jobs` processes; default: this workplace's, else the number of cores."""
        with self.time_limit():
            return bring_up_to_date(tasks, self.store, self.sources, self.monitor, jobs or self.jobs)

    def artifacts(self, outcome: Outcome) -> dict[Task, Made]:
        """Return the artifacts that `bring_up_to_date` produced or that were up to date, by task."""
        return {task: Made(task, record, self.store) for task, record in outcome.records.items()}

    def made(self, *tasks: Task, jobs: int | None = None) -> list[Made]:
        """Bring tasks up to date and return their artifacts; raise as `check` does when a task or an input fails."""
        outcome = self.bring(list(tasks), jobs)
        check(outcome)
        by_task = self.artifacts(outcome)
        return [by_task[task] for task in tasks]

    def datasets(self, *tasks: Task, jobs: int | None = None) -> list[xr.Dataset]:
        """Bring tasks up to date and return their main files."""
        return [one.dataset() for one in self.made(*tasks, jobs=jobs)]

    def time_limit(self) -> AbstractContextManager[None]:
        """Return a context that stops the work inside when the command's time limit is over."""
        end, why = self.end
        return stopping.stop_after(None if end == math.inf else end - time.monotonic(), why)


def open_workplace(options: argparse.Namespace | None = None) -> Workplace:
    """Return the usual workplace, with results where `results_root` places them.

    options: of a command, with `jobs`, `limit` and the amount of output.
    """
    workers.require_guard()
    if options is not None:
        set_level(quiet=getattr(options, "quiet", False), verbose=getattr(options, "verbose", False))
    monitor, root = Monitor(), results_root()
    jobs, limit = getattr(options, "jobs", None), getattr(options, "limit", None)
    if jobs is not None and jobs < 1:
        raise InputError("--jobs", f"must be at least 1 (got {jobs})", "leave it out to use every core")
    end = math.inf if limit is None else time.monotonic() + seconds(limit, "--limit")
    sources = sources_of(TREE, root / "cache" / "code.json")
    why = f"the time limit (--limit {limit}) is reached"
    # cached: the same damaged file is found each time that a task asks for it, and reported once
    return Workplace(Store(root, say=cache(monitor.say)), sources, monitor, jobs, (end, why))


def check(outcome: Outcome) -> None:
    """Raise the first failure's kind of error (InputError, SolverError, ResourceError) with the messages of all."""
    for first in outcome.failures[:1]:
        text = "\n".join(failure.message for failure in outcome.failures)
        raise error_of(first.exit_code, f"{first.task.scene} {first.task.label}", text)
