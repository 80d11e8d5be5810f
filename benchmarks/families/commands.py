"""Times of whole commands from the shell, by parts of the work, and of points of a loop in Python."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.command_parts import IMPORTS, REST
from benchmarks.family import Case, Family, Measured, Record
from benchmarks.page import Columns, spread, table
from benchmarks.processes import as_installed
from benchmarks.timing import Times, interleaved, of_children
from flexclear.artifacts.paths import PROJECT, results_root
from flexclear.system.platforms import count_cores

#: number of rounds; single ones take up to a quarter longer on a machine that others use as well
ROUNDS = 11
#: parts in the order of the table; all other parts belong to the rest
SHOWN = ("interpreter", IMPORTS, "scene", "keys", "assembling", "integrating", "recording", "writing", "deriving", REST)
LOOP = """import sys, time
import flexclear as fc
scene, times = fc.load_scene(sys.argv[1]), []
for k in range(8):
    begun, waited = time.process_time(), time.monotonic()
    fc.run(fc.edited(scene, {sys.argv[2]: float(sys.argv[3]) * (1.0 + 1e-6 * k)}))
    times.append((time.process_time() - begun, time.monotonic() - waited))
print(*(sorted(kind)[4] for kind in zip(*times)))"""


@dataclass(frozen=True)
class Command:
    """A program with arguments, in which ``{}`` is a number that changes with each run.

    value: approximate value of that number.  own: True to use the project's results instead of empty ones.
    loop: True for a loop over `flexclear.run` in Python, of which one point counts.
    """

    arguments: tuple[str, ...]
    value: float = 0.0
    own: bool = False
    loop: bool = False
    program: str = "flexclear"


_CSJ, _IDEAL = "scenes/sps4/csj.toml", "scenes/sps4/ideal.toml"
_CLEARANCE, _MASS, _PIN = ("joint.A1.clearance", 0.0005), ("body.platform.mass", 0.31), ("joint.pin.clearance", 0.00014)
_NEW = "pipeline/flexclear/stages/templates/slider_crank/slider_crank.toml"
COMMANDS: Mapping[str, Command] = {
    "run csj, a changed number": Command(("run", "-q", _CSJ, "--set", f"{_CLEARANCE[0]}={{}}"), _CLEARANCE[1]),
    "run ideal, a changed number": Command(("run", "-q", _IDEAL, "--set", f"{_MASS[0]}={{}}"), _MASS[1]),
    "run slider-crank of `new`, a changed number": Command(("run", "-q", _NEW, "--set", f"{_PIN[0]}={{}}"), _PIN[1]),
    "run csj, nothing changed": Command(("run", "-q", _CSJ)),
    "check csj": Command(("check", _CSJ)),
    "report of the paper, nothing changed": Command(("-q",), own=True, program="papers.wang_wang_2019"),
    "a point of a loop over csj": Command((_CSJ, _CLEARANCE[0], "{}"), _CLEARANCE[1], loop=True),
    "a point of a loop over ideal": Command((_IDEAL, _MASS[0], "{}"), _MASS[1], loop=True),
}


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each command; commands take turns. Bytecode is cached, as by an installed program."""
    with TemporaryDirectory() as folder:
        fresh = (1.0 + 1e-7 * k for k in itertools.count())
        waits = {case.name: list[float]() for case in cases}
        tasks = {name: _timed(COMMANDS[name], Path(folder), fresh, waits[name]) for name in waits}
        times = interleaved(tasks, ROUNDS)
        for case in cases:
            command = COMMANDS[case.name]
            parts = (
                {} if command.loop else json.loads(_run(command, Path(folder), fresh, ("benchmarks.command_parts",)))
            )
            fractions = {name: parts.pop(name, 0.0) for name in SHOWN} if parts else {}
            wall = Times(tuple(waits[case.name][-ROUNDS:])).record("s")
            yield (
                case,
                [{"cpu": times[case.name].record("s"), "wall": wall, "processors": count_cores(), "parts": fractions}],
            )


def _timed(command: Command, folder: Path, fresh: Iterator[float], waits: list[float]) -> Callable[[], float]:
    """Return a function that runs a command, returns its processor time and appends its wall time to `waits` [s]."""

    def seconds() -> float:
        if command.loop:
            spent, wall = (float(text) for text in _run(command, folder, fresh).split())
        else:
            begun = time.monotonic()
            spent = of_children(lambda: _run(command, folder, fresh))
            wall = time.monotonic() - begun
        waits.append(wall)
        return spent

    return seconds


def _run(command: Command, folder: Path, fresh: Iterator[float], around: tuple[str, ...] = ()) -> str:
    """Run a command and return the last line of its output."""
    program = ["-c", LOOP] if command.loop else ["-m", *around, command.program]
    arguments = [text.format(repr(command.value * next(fresh))) for text in command.arguments]
    environment = as_installed(folder) | ({"FLEXCLEAR_RESULTS": str(results_root())} if command.own else {})
    done = subprocess.run(
        [sys.executable, *program, *arguments],
        cwd=PROJECT,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    return done.stdout.splitlines()[-1]


def show(records: list[Record]) -> str:
    """Return the table: processor and wall seconds, and the parts of the former in milliseconds."""
    columns: Columns = {
        "command": lambda r: r["case"],
        "CPU [s]": lambda r: spread(r["cpu"], "s", 2),
        "wall [s]": lambda r: spread(r["wall"], "s", 2),
        "processors": lambda r: str(r["processors"]),
        **{f"{part} [ms]": lambda r, part=part: _milliseconds(r["parts"], part) for part in SHOWN},  # type: ignore[misc]
    }
    return table(records, columns)


def _milliseconds(parts: Mapping[str, float], part: str) -> str:
    return f"{1e3 * parts[part]:.0f}" if parts.get(part) else ""


FAMILY = Family(
    what="seconds of whole commands, and what they go into; not to be held to one processor",
    takes="2 min, and what is stale of the report",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in COMMANDS],
    measure=measure,
    show=show,
    quick="check csj",
    children=True,
)
