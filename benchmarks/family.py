"""How a benchmark declares itself; what is common to all of them is in the modules next to this one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any

#: one measurement: `case`, then numbers and words as JSON has them
Record = dict[str, Any]
#: what a record may have as `verdict`; one that is wrong makes the command fail
FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


@dataclass(frozen=True)
class Case:
    """One thing to measure. of: what the family needs to know of it; with the name it says which case it is."""

    name: str
    of: Any = None


Measured = Iterator[tuple[Case, list[Record]]]


def each(of: Callable[[Case], list[Record]]) -> Callable[[Sequence[Case], int], Measured]:
    """What measures cases one after the other, in this process."""

    @wraps(of)  # sources of a result are those of its module
    def measure(cases: Sequence[Case], jobs: int) -> Measured:
        for case in cases:
            yield case, of(case)

    return measure


@dataclass(frozen=True)
class Family:
    """A benchmark.

    what: it measures, in a sentence.  takes: how long that takes.
    page: file below docs/ in which the lines between its marks are what `show` makes (see `benchmarks.page`).
    cases: all of them, called with the numbers of `settings`, which `--set` changes.
    measure: some of them, in at most so many processes, each with its records as soon as it is done.
    show: records of some or all cases as Markdown, or several parts of the page by name.
    files: what belongs to the page, by path below docs/.
    quick: the smallest case, where it takes below 5 s warm.
    times: whether times are the subject. If so, the log keeps every measurement, with four digits, since what is
    behind them is noise; else the last one, with all digits.
    modules: what decides about a case. With it, a result is valid until a source that they import changes; without
    it, a case is measured again whenever that is asked for.
    needs: an optional library, and the extra of this project that brings it.
    children: it measures or limits child processes, which not every system can (`benchmarks.processes`).
    """

    what: str
    takes: str
    page: str
    cases: Callable[..., Sequence[Case]]
    measure: Callable[[Sequence[Case], int], Measured]
    show: Callable[[list[Record]], str | Mapping[str, str]]
    files: Callable[[list[Record]], Mapping[str, bytes]] = lambda records: {}
    quick: str = ""
    settings: Mapping[str, int] = field(default_factory=dict)
    times: bool = True
    modules: Callable[[Case], set[str]] | None = None
    needs: tuple[str, str] | None = None
    children: bool = False
