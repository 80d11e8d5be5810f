"""Log of measurements with date and machine: one file of JSON lines for each family.

A line with `measured` (the date), `cpu` and `versions` begins a session; every later line is one measurement with
its `case`. Machine and date appear nowhere else. `cpu` is null where it was not recorded.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import math
import platform
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.family import FINISHED, Case, Family, Record
from flexclear.artifacts.paths import results_root
from flexclear.workflow.fingerprint import CORE, TREE, library_version, sources_of

FOLDER = Path(__file__).parent / "log"
PACKAGES = ("flexclear", "numpy", "scipy", "numba", "exudyn", "pin", "mujoco")
#: significant digits of measured times
DIGITS = 4


@dataclass(frozen=True)
class Session:
    """Date and machine of some measurements.  cpu: the processor's model, no name of a machine.  note: for readers."""

    measured: str
    cpu: str | None
    versions: dict[str, str]
    note: str = ""
    records: list[Record] = field(default_factory=list)


def today() -> Session:
    """Return a session without records, with today's date and this machine."""
    versions = {name: known for name in PACKAGES if (known := library_version(name)) != "absent"}
    return Session(datetime.date.today().isoformat(), _processor(), {"python": platform.python_version(), **versions})


def read(path: Path) -> list[Session]:
    """Return all sessions of a file, in their order."""
    found: list[Session] = []
    for line in map(json.loads, path.read_text(encoding="utf-8").splitlines() if path.exists() else ()):
        if "measured" in line:
            found.append(Session(**line))
        else:
            found[-1].records.append(line)
    return found


def latest(path: Path) -> list[Session]:
    """Return the sessions, each reduced to the records of cases that no later session has."""
    found, known = [], set[str]()
    for session in reversed(read(path)):
        kept = [record for record in session.records if record["case"] not in known]
        known |= {record["case"] for record in kept}
        if kept:
            found.append(Session(session.measured, session.cpu, session.versions, session.note, kept))
    return found[::-1]


def append(path: Path, session: Session, *, history: bool) -> None:
    """Append a session.  history: keep older records of the session's cases; otherwise delete them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8", newline="\n") as file:
        file.writelines(_lines(session))
    if not history:
        path.write_text("".join(line for kept in latest(path) for line in _lines(kept)), encoding="utf-8", newline="\n")


def _lines(session: Session) -> list[str]:
    head = {name: value for name, value in asdict(session).items() if name != "records" and value != ""}
    return [json.dumps(line, allow_nan=False) + "\n" for line in (head, *session.records)]


def plain(value: Any, digits: int | None) -> Any:
    """Return a value that JSON can hold: floats at any depth rounded to `digits`, non-finite ones as None."""
    if isinstance(value, dict):
        return {key: plain(inner, digits) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(inner, digits) for inner in value]
    if not isinstance(value, float):
        return value
    return None if not math.isfinite(value) else value if digits is None else float(f"{value:.{digits}g}")


class Memory:
    """Earlier results, one line for each case, so that an interrupted measurement continues where it stopped.

    A line is valid while the case, the sources that it reaches, the processor and the versions are unchanged.
    trusting: accept finished cases also when their sources have changed.
    """

    def __init__(self, family: str, spec: Family, *, trusting: bool = False, folder: Path | None = None) -> None:
        self.spec, self.trusting = spec, trusting
        self.file = (folder or results_root() / "benchmarks") / f"{family}.jsonl"
        lines = self.file.read_text(encoding="utf-8").splitlines() if self.file.exists() else []
        self.known = {line["of"]: line for line in map(json.loads, lines)}

    def recall(self, case: Case) -> list[Record] | None:
        """Return the records of a case, or None when no valid ones exist."""
        line = self.known.get(_identity(case))
        if line is None or line["sources"] == sources(self.spec):
            return line and line["records"]
        good = all(record.get("verdict", FINISHED) == FINISHED for record in line["records"])
        return line["records"] if self.trusting and good else None

    def learn(self, case: Case, records: list[Record]) -> None:
        """Store the records of a case immediately."""
        line = {"of": _identity(case), "sources": sources(self.spec), "records": records}
        self.known[line["of"]] = line
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a", encoding="utf-8", newline="\n") as file:
            file.write(json.dumps(line) + "\n")

    def forget(self, cases: list[Case]) -> None:
        """Drop the results of logged cases, unless the family's results stay valid until sources change."""
        if not self.spec.code and self.file.exists():
            for case in cases:
                self.known.pop(_identity(case), None)
            self.file.write_text(
                "".join(json.dumps(line) + "\n" for line in self.known.values()), encoding="utf-8", newline="\n"
            )


def _identity(case: Case) -> str:
    now = today()
    return f"{case!r} on {now.cpu} with {now.versions}"


def sources(spec: Family) -> str:
    """Return the digest of the code by which a family measures, and of what it measures."""
    return _digest((*spec.code, *(CORE if spec.code else ()), spec.measure.__module__))


@cache
def _digest(names: tuple[str, ...]) -> str:
    return hashlib.sha256(json.dumps(sources_of(TREE).code(names), sort_keys=True).encode()).hexdigest()


@cache
def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
