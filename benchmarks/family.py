"""Declaration of a benchmark family: its cases, how they are measured, and how records become a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any

#: one measurement: `case`, then numbers and texts that JSON can hold
Record = dict[str, Any]
#: values of a record's `verdict`; a record with WRONG makes the command fail
FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


@dataclass(frozen=True)
class Case:
    """One item to measure.  of: parameters that the family needs; name and parameters together identify the case."""

    name: str
    of: Any = None


Measured = Iterator[tuple[Case, list[Record]]]


def each(of: Callable[[Case], list[Record]]) -> Callable[[Sequence[Case], int], Measured]:
    """Return a `measure` function that measures the cases one after the other in this process."""

    @wraps(of)  # so that the sources of a result are those of the wrapped function's module
    def measure(cases: Sequence[Case], jobs: int) -> Measured:
        for case in cases:
            yield case, of(case)

    return measure


@dataclass(frozen=True)
class Family:
    """A family of benchmark cases.

    what: subject of the measurement, in one sentence.  takes: its duration, in words.
    page: file below docs/; `show` writes the lines between the family's marks (see `benchmarks.page`).
    cases: returns all cases; its arguments are the numbers of `settings`, which `--set` changes.
    measure: measures some cases in at most the given number of processes; yields the records of each case when done.
    show: turns the records of some or all cases into Markdown, or into several parts of the page by name.
    rows: pattern of the rows that a page shows of long tables, which are complete in docs/tables (`page.shortened`).
    files: files that belong to the page, by path below docs/.
    quick: name of the smallest case, where it takes less than 5 s warm.
    times: True when times are the subject. The log then keeps every measurement, with four digits, since further
    digits are noise; otherwise it keeps only the last measurement, with all digits.
    code: packages and modules whose code, besides the core's, determines results. With it, a result is valid until that
    changes; without it, a case is measured again at each request.
    needs: an optional library, and the extra of this project that installs it.
    children: the family measures or limits child processes, which not every system can (`benchmarks.processes`).
    """

    what: str
    takes: str
    page: str
    cases: Callable[..., Sequence[Case]]
    measure: Callable[[Sequence[Case], int], Measured]
    show: Callable[[list[Record]], str | Mapping[str, str]]
    rows: str = ""
    files: Callable[[list[Record]], Mapping[str, bytes]] = lambda records: {}
    quick: str = ""
    settings: Mapping[str, int] = field(default_factory=dict)
    times: bool = True
    code: tuple[str, ...] = ()
    needs: tuple[str, str] | None = None
    children: bool = False
