"""Progress on stderr: the running scene and stage, and the estimated remaining time.

Permanent lines are records of the logger (`core.system.log`); the line that a terminal or a notebook rewrites is not. A
library would replace only the rewritten line: neither Rich, whose import takes 0.1 s of processor time, nor tqdm writes
sparse lines where the output is a file.
"""

from __future__ import annotations

import html
import logging
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TextIO

from flexclear.system.log import LOG, write_to

#: least number of samples for an estimate of the remaining time, and least fraction of the work in each
SAMPLES, ENOUGH = 3, 0.01
#: weight of each sample relative to the next, so that the last one counts most
FADING = 0.8
#: reports of a task that begin with this text become permanent lines
WARNING = "warning: "


@dataclass
class Job:
    """A running task on the screen."""

    name: str
    started: float
    since: tuple[float, float] | None = None  #: time and finished fraction where the last sample began
    samples: int = 0
    spent: float = 0.0  #: weighted sums over all samples: time [s], and fraction of the work in `advanced`
    advanced: float = 0.0
    fraction: float | None = None
    text: str = ""
    last_line: float = 0.0  #: time of the last permanent line
    told: set[str] = field(default_factory=set)  #: texts without a fraction; each run of a search repeats them


@dataclass
class Monitor:
    """Displays running tasks: on a terminal as one line that is rewritten, in a notebook as bars, else as sparse lines.

    The logger's level decides the amount: from WARNING on no progress; at DEBUG a line for every report.
    """

    out: TextIO = field(default_factory=lambda: sys.stderr)
    clock: Callable[[], float] = time.monotonic
    jobs: dict[str, Job] = field(default_factory=dict)
    total: int = 0
    done: int = 0
    drawn: float = 0.0
    cell: Any = None  #: the output of a notebook's cell that shows progress

    def __post_init__(self) -> None:
        write_to(self.out)

    @property
    def quiet(self) -> bool:
        """True when only warnings are printed."""
        return not LOG.isEnabledFor(logging.INFO)

    @property
    def verbose(self) -> bool:
        """True when every report of a task becomes a permanent line."""
        return LOG.isEnabledFor(logging.DEBUG)

    @property
    def rewrites(self) -> bool:
        """True when what is shown is replaced, as on a terminal."""
        return (self.out.isatty() or _in_notebook(self.out)) and not self.verbose

    def start(self, total: int) -> None:
        """Set the number of tasks to run."""
        self.total, self.done = total, 0

    def begin(self, scene: str, label: str) -> str:
        """Note the start of a task; return the name to report under, which no other running task has."""
        plain = name = f"{scene}: {label}"
        others = 1
        while name in self.jobs:  # an edited copy of a scene has tasks of the same label
            others += 1
            name = f"{plain} ({others})"
        self.jobs[name] = Job(name, self.clock(), last_line=self.clock())
        self._show(f"{self._count()}{name}")
        return name

    def update(self, name: str, fraction: float | None, text: str) -> None:
        """Note that a task is `fraction` done (None: unknown) and doing `text`."""
        job = self.jobs.get(name)
        if job is None:
            return
        news = fraction is None and text not in job.told
        job.told |= {text} if news else set()
        if news and text.startswith(WARNING) and (self.rewrites or self.quiet):
            self.say(f"{job.name}: {text}")  # a permanent line, since the line of progress is rewritten or absent
        # work without a fraction (compiling, waiting) does not enter the estimate of the remaining time
        if fraction is None or job.since is None or fraction < job.since[1]:  # restarted, e.g. at another tolerance
            job.since = None if fraction is None else (self.clock(), fraction)
        elif fraction - job.since[1] >= ENOUGH:
            job.spent = FADING * job.spent + self.clock() - job.since[0]
            job.advanced = FADING * job.advanced + fraction - job.since[1]
            job.since, job.samples = (self.clock(), fraction), job.samples + 1
        job.fraction, job.text = fraction, text
        # 10.0: least time between two permanent lines of one task [s]
        if self.rewrites or self.verbose or news or self.clock() - job.last_line >= 10.0:
            job.last_line = self.clock()
            self._show(f"{self._count()}{self._line(job)}")

    def finish(self, name: str, *, failed: bool) -> None:
        """Note the end of a task."""
        job = self.jobs.pop(name)
        self.done += 1
        seconds = self.clock() - job.started
        if not self.rewrites and (failed or seconds >= 1.0):
            self._show(f"{self._count()}{name} {'failed' if failed else 'done'} after {duration(seconds)}")
        elif self.rewrites:
            self._show("")

    def end(self) -> None:
        """Clear the line after all tasks have ended."""
        if self.rewrites and not self.quiet:
            self._rewrite("")
            self.cell = None

    def say(self, text: str) -> None:
        """Print a warning as a permanent line."""
        if self.rewrites and not self.quiet:
            self._rewrite("")
        LOG.warning("%s", text)

    def _count(self) -> str:
        """Return the number of finished tasks as a prefix; empty for a single task."""
        return f"[{self.done}/{self.total}] " if self.total > 1 else ""

    def _line(self, job: Job) -> str:
        parts = [job.name]
        if job.fraction is not None:
            parts.append(f"{job.fraction:4.0%}")
            if job.samples >= SAMPLES:
                parts.append(f"{duration(self._seconds_per_fraction(job) * (1.0 - job.fraction))} left")
        return " ".join([*parts, *([job.text] if job.text else [])])

    def _seconds_per_fraction(self, job: Job) -> float:
        """Return the time per fraction [s]; the current sample counts as soon as it is slower than earlier ones."""
        known = job.spent / job.advanced
        if job.since is None or job.fraction is None:
            return known
        spent, fraction = self.clock() - job.since[0], job.fraction - job.since[1]
        return max(known, (FADING * job.spent + spent) / (FADING * job.advanced + fraction))

    def _show(self, text: str) -> None:
        if self.quiet:
            return
        if not self.rewrites:
            LOG.info("%s", text)
        # 0.1: least time between two redraws of the line on a terminal [s]
        elif self.clock() - self.drawn >= 0.1 or not text:
            self.drawn = self.clock()
            self._rewrite(self._count() + " | ".join(self._line(job) for job in self.jobs.values()))

    def _rewrite(self, line: str) -> None:
        """Replace the line on the terminal, or in a notebook the bars of the cell."""
        if not _in_notebook(self.out):
            self.out.write(f"\r\033[K{line[: _columns(self.out)]}")
            self.out.flush()
            return
        from IPython.display import HTML, display

        bars = "".join(_bar(job.fraction, self._line(job)) for job in self.jobs.values()) if line else ""
        shown = HTML(f"{self._count()}{bars}" if bars else "")
        if self.cell is not None:
            self.cell.update(shown)
        elif bars:
            self.cell = display(shown, display_id=True)


def duration(seconds: float) -> str:
    """Return a time in words: ``4.2 s``, ``3 min 10 s``."""
    if round(seconds, 1) < 60.0:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s"


def _in_notebook(out: TextIO) -> bool:
    """Return True for the output of a notebook's cell, which shows HTML."""
    return type(out).__module__.partition(".")[0] == "ipykernel"


def _bar(fraction: float | None, text: str) -> str:
    """Return a bar as HTML; without a fraction it shows that work goes on."""
    value = "" if fraction is None else f" value='{fraction:.3f}'"
    return f"<div><progress max='1'{value}></progress> {html.escape(text)}</div>"


def _columns(out: TextIO) -> int:
    import os

    try:
        return os.get_terminal_size(out.fileno()).columns - 1
    except (OSError, ValueError):
        return 79
