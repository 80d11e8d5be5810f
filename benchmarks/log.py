"""The log, one file of JSON lines for each family: what was measured, when, and on what machine.

A line with `measured` (the date), `cpu` and `versions` begins a session; every line after it is one measurement with
its `case`. Machine and date stand nowhere else. `cpu` is null where nobody noted it.
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
from flexclear.pipeline.core.artifacts.paths import results_root
from flexclear.pipeline.core.workflow.fingerprint import TREE, Sources, library_version

FOLDER = Path(__file__).parent / "log"
PACKAGES = ("flexclear", "numpy", "scipy", "numba", "exudyn", "pin", "mujoco")
#: digits of measured times
DIGITS = 4


@dataclass(frozen=True)
class Session:
    """Date and machine of some measurements. cpu: the processor's model; no name of a machine.  note: for readers."""

    measured: str
    cpu: str | None
    versions: dict[str, str]
    note: str = ""
    records: list[Record] = field(default_factory=list)


def today() -> Session:
    """A session on this machine."""
    versions = {name: known for name in PACKAGES if (known := library_version(name)) != "absent"}
    return Session(datetime.date.today().isoformat(), _processor(), {"python": platform.python_version(), **versions})


def read(path: Path) -> list[Session]:
    """All sessions of a file, in their order."""
    found: list[Session] = []
    for line in map(json.loads, path.read_text(encoding="utf-8").splitlines() if path.exists() else ()):
        if "measured" in line:
            found.append(Session(**line))
        else:
            found[-1].records.append(line)
    return found


def latest(path: Path) -> list[Session]:
    """The sessions with those records only whose case no later session has."""
    found, known = [], set[str]()
    for session in reversed(read(path)):
        kept = [record for record in session.records if record["case"] not in known]
        known |= {record["case"] for record in kept}
        if kept:
            found.append(Session(session.measured, session.cpu, session.versions, session.note, kept))
    return found[::-1]


def append(path: Path, session: Session, *, history: bool) -> None:
    """Add a session. history: keep what it measured anew; else the older records of its cases go."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8", newline="\n") as file:
        file.writelines(_lines(session))
    if not history:
        path.write_text("".join(line for kept in latest(path) for line in _lines(kept)), encoding="utf-8", newline="\n")


def _lines(session: Session) -> list[str]:
    head = {name: value for name, value in asdict(session).items() if name != "records" and value != ""}
    return [json.dumps(line, allow_nan=False) + "\n" for line in (head, *session.records)]


def plain(value: Any, digits: int | None) -> Any:
    """What JSON can say: floats at any depth with so many digits, those that are no number as null."""
    if isinstance(value, dict):
        return {key: plain(inner, digits) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(inner, digits) for inner in value]
    if not isinstance(value, float):
        return value
    return None if not math.isfinite(value) else value if digits is None else float(f"{value:.{digits}g}")


class Memory:
    """What is measured already, so that what was interrupted goes on where it stopped: a line for each case.

    A line is valid as long as the case, the sources that it reaches, the processor and the versions are the same.
    trusting: also with other sources, of cases that finished.
    """

    def __init__(self, family: str, spec: Family, *, trusting: bool = False, folder: Path | None = None) -> None:
        self.spec, self.trusting = spec, trusting
        self.file = (folder or results_root() / "benchmarks") / f"{family}.jsonl"
        lines = self.file.read_text(encoding="utf-8").splitlines() if self.file.exists() else []
        self.known = {line["of"]: line for line in map(json.loads, lines)}

    def recall(self, case: Case) -> list[Record] | None:
        """The records of a case, when they are known."""
        line = self.known.get(_identity(case))
        if line is None or line["sources"] == sources(self.spec, case):
            return line and line["records"]
        good = all(record.get("verdict", FINISHED) == FINISHED for record in line["records"])
        return line["records"] if self.trusting and good else None

    def learn(self, case: Case, records: list[Record]) -> None:
        """Keep the records of a case, at once."""
        line = {"of": _identity(case), "sources": sources(self.spec, case), "records": records}
        self.known[line["of"]] = line
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a", encoding="utf-8", newline="\n") as file:
            file.write(json.dumps(line) + "\n")

    def forget(self, cases: list[Case]) -> None:
        """Measure again what is in the log, unless it is valid until sources change."""
        if self.spec.modules is None and self.file.exists():
            for case in cases:
                self.known.pop(_identity(case), None)
            self.file.write_text(
                "".join(json.dumps(line) + "\n" for line in self.known.values()), encoding="utf-8", newline="\n"
            )


def _identity(case: Case) -> str:
    now = today()
    return f"{case!r} on {now.cpu} with {now.versions}"


def sources(spec: Family, case: Case) -> str:
    """Digest of the source that measuring a case reaches."""
    own = spec.measure.__module__
    if spec.modules is None:
        return _digest(frozenset({own}))
    module = _tree().module(own)
    return f"{module and module.digest} {_digest(frozenset(spec.modules(case)))}"


@cache
def _digest(roots: frozenset[str]) -> str:
    found = sorted((name, module.digest) for name, module in _tree().closure(roots).items())
    return hashlib.sha256(json.dumps(found).encode()).hexdigest()


@cache
def _tree() -> Sources:
    return Sources(TREE)


@cache
def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
