"""A campaign of faults: damaged files, folders instead of files, killed commands and child processes, full disks.

A fault is *detected* when damaged content counts as absent, or when a command ends with an exit code of its own and a
message. It is *harmless* when nothing is lost. It is *used* when damaged content would be used, or when a command ends
with a traceback; neither may happen. The project's own results stay untouched.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import psutil

from benchmarks import processes
from benchmarks.family import FINISHED, WRONG, Case, Family, Measured, Record
from benchmarks.page import Columns, table
from flexclear.artifacts import maintenance
from flexclear.artifacts.disk import read_checked
from flexclear.artifacts.store import Store, read_record
from flexclear.dynamics.compile.files import CODE, is_compiled
from flexclear.workflow.journal import Journal

SCENE = "checks/pendulum"
#: command -> its fraction of all kills, and its arguments; the sweep is of a scene that takes some seconds
COMMANDS = {
    "run": (0.25, ["run", SCENE, "checks/spring_pendulum"]),
    "sweep": (0.15, ["sweep", "{folder}/sweep.toml", "--jobs", "2"]),
    "cost": (0.15, ["cost", SCENE, "--integrators", "dopri5"]),
    "report": (0.15, ["report", SCENE, "--answers", "none"]),
    "render": (0.1, ["render", SCENE, "--what", "motion", "--format", "png"]),
    "sections": (0.1, ["sections", "checks/driven_pendulum"]),
    "plan": (0.1, ["plan", SCENE]),
}
#: commands with child processes, of which one is killed instead, and number of these kills per kill of the command
HELPED, PER_KILL = ("run", "sweep", "cost", "report"), 0.5
#: a child process is idle while it uses less than this processor time [s] within this time [s]
IDLE, LOOK = 0.005, 0.1
#: exit codes of a command that lost a child process: it continues without, or reports that its memory may be full
LOST_CHILD = (0, 4)
SWEEP = """
title = "Pendulums"
scene = "checks/pendulum"
keep = ["bob.position.final"]
[vary]
"body.bob.mass" = { from = 1.0, to = 2.0, count = 400 }
"""
#: a command is killed within this time [s], or within its own duration where that is shorter
LATEST = 15.0
#: file size limits that represent full disks [B], and number of commands that run concurrently
FULL, CONCURRENT = (0, 200, 2_000, 8_000, 20_000, 40_000, 80_000, 200_000), 8
#: stages whose artifacts are computed, not measured
COMPUTED = ("mesh", "modes", "bundle", "simulate", "post")
Judge = Callable[[], str]
DAMAGED = (
    "artifacts",
    "records",
    "shown files",
    "memo of code",
    "generated sources",
    "digests of kernels",
    "compiled code",
    "unfinished work",
)
FOLDERS, FILES = "folders instead of files", "files instead of folders"
FULL_DISKS, AT_ONCE = "disks full (files of at most so many bytes)", "equal commands at once"
COLUMNS: Columns = {
    "fault in": lambda r: r["case"],
    "faults": lambda r: str(r["faults"]),
    "detected": lambda r: str(r["detected"]),
    "harmless": lambda r: str(r["harmless"]),
    "used": lambda r: str(r["used"]),
}


@dataclass(frozen=True)
class Faults:
    """Numbers of faults of a kind.  flips, cuts: of files; kills: of commands or children; seed: of random choices."""

    seed: int
    flips: int = 0
    cuts: int = 0
    kills: int = 0


def cases(seed: int, flips: int, cuts: int, kills: int) -> list[Case]:
    """Return all kinds of faults as cases."""
    made = [Case(kind, Faults(seed, flips, cuts)) for kind in DAMAGED]
    made += [Case(kind, Faults(seed)) for kind in (FOLDERS, FILES, FULL_DISKS, AT_ONCE)]
    for verb, (fraction, _) in COMMANDS.items():
        count = max(1, round(fraction * kills))
        made.append(Case(f"`{verb}` killed", Faults(seed, kills=count)))
        if verb in HELPED:
            helpers = Faults(seed, kills=max(1, round(PER_KILL * count)))
            made += [Case(f"{which} of `{verb}` killed", helpers) for which in ("helpers", "idle helpers")]
    return made


@dataclass(frozen=True)
class Place:
    """Folder of the campaign; the results of each fault are in folders below it."""

    folder: Path

    def store(self, results: str = "results") -> Store:
        """Return the store of the results in a folder below this one."""
        return Store(self.folder / results)

    def start(self, words: Sequence[str], results: str = "results", **more: Any) -> subprocess.Popen[bytes]:
        """Start a command on results in a folder below this one."""
        here = {"FLEXCLEAR_RESULTS": str(self.folder / results), "FLEXCLEAR_KERNELS": str(self.folder / "kernels")}
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        command = [sys.executable, "-m", "flexclear", *(word.format(folder=self.folder) for word in words)]
        return subprocess.Popen(command, env={**os.environ, **here}, **{**silent, **more})

    def whole(self, words: Sequence[str], results: str) -> tuple[float, dict[tuple[str, str], str]]:
        """Run a command undisturbed on empty results; return its duration [s] and the digests of its artifacts."""
        begun = time.monotonic()
        code = self.start(words, results).wait()
        assert code == 0, f"{words[0]} ends with {code}"
        return time.monotonic() - begun, _artifacts(self.store(results))


def measure(todo: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each kind of fault, in a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="faults_") as name:
        place = Place(Path(name))
        (place.folder / "sweep.toml").write_text(SWEEP, encoding="utf-8", newline="\n")
        if any("killed" not in case.name for case in todo):
            place.whole(["run", SCENE], "results")
        for case in todo:
            yield case, [_recorded(_counted(case, place))]


def _recorded(count: Counter[str]) -> Record:
    kinds = {name: count[name] for name in ("detected", "harmless", "used")}
    return {"verdict": WRONG if count["used"] else FINISHED, "faults": sum(count.values()), **kinds}


def _counted(case: Case, place: Place) -> Counter[str]:
    """Cause the faults of a case, and count their outcomes."""
    of, rng = case.of, random.Random(f"{case.of.seed} {case.name}")
    if case.name in DAMAGED:
        return _damage(rng, _damaged(place)[case.name], of.flips, of.cuts)
    for kind, bring_about in ((FOLDERS, _folders), (FILES, _files), (FULL_DISKS, _full), (AT_ONCE, _concurrent)):
        if case.name == kind:
            return bring_about(place)
    which, verb, _ = case.name.split("`")
    kill = partial(_helpers, idle="idle" in which) if which else _kills
    return kill(place, verb, rng, of.kills)


def _damaged(place: Place) -> dict[str, list[tuple[Path, Judge]]]:
    """Return the files of each kind, each with a function that returns whether damage to the file is detected."""
    store, folder = place.store(), place.folder
    records = sorted((store.root / "cache").glob("*/*.json"))
    kernels = sorted((folder / "kernels").glob("*/flexclear_*.py"))
    shown = sorted((store.root / "runs").rglob("*.nc"))
    return {
        "artifacts": [(path.with_suffix(".nc"), _artifact(store, path)) for path in records],
        "records": [(path, _same(read_record, path)) for path in records],
        "shown files": [(path, partial(_shown, store)) for path in shown],
        "memo of code": [(path, _same(read_checked, path)) for path in [store.root / "cache" / "code.json"]],
        "generated sources": [(path, _kernel(path)) for path in kernels],
        "digests of kernels": [(path.with_suffix(".sum"), _kernel(path)) for path in kernels],
        "compiled code": [(path.with_suffix(CODE), _kernel(path)) for path in kernels],
        "unfinished work": [(path, _piece(path)) for path in _unfinished(folder)],
    }


def _damage(rng: random.Random, files: list[tuple[Path, Judge]], flips: int, cuts: int) -> Counter[str]:
    """Count the outcomes of flips and cuts in one kind of file; each file is restored afterwards."""
    return Counter(_fault(rng, *rng.choice(files), flip=k < flips) for k in range(flips + cuts))


def _shown(store: Store) -> str:
    return "detected" if maintenance.shown_faults(store, store.root / "runs") else "used"


def _folders(place: Place) -> Counter[str]:
    """Put a folder in place of each file of a run in turn: it must be renamed, and the result must be the same."""
    store, count = place.store(), Counter[str]()
    before = _artifacts(store)
    cached = [
        path for suffix in ("nc", "json", "names") for path in sorted((store.root / "cache").glob(f"*/*.{suffix}"))
    ]
    shown = sorted((store.root / "runs").rglob("*.nc"))
    for path in [*cached, *shown, store.root / "cache" / "code.json"]:
        path.unlink(missing_ok=True)
        path.mkdir()
        (path / "mine").write_text("stays", encoding="utf-8", newline="\n")
        code = place.start(["run", SCENE]).wait()
        lost = not any(left.read_text(encoding="utf-8") == "stays" for left in path.parent.glob(f"{path.name}*/mine"))
        sound = code == 0 and not lost and _artifacts(store) == before and _shown(store) == "used"
        count["detected" if sound else "used"] += 1
    return count


def _files(place: Place) -> Counter[str]:
    """Put a file in place of each folder of a run in turn: it must be renamed, or named in a message, and survive."""
    store, count = place.store(), Counter[str]()
    before = _artifacts(store)
    for path in [
        store.root / "runs" / SCENE,
        *sorted(path for path in (store.root / "cache").iterdir() if path.is_dir()),
    ]:
        away = path.rename(place.folder / "away")
        path.write_text("stays", encoding="utf-8", newline="\n")
        process = place.start(["run", SCENE], stderr=subprocess.PIPE)
        output = process.communicate()[1].decode(errors="replace")
        left = [one for one in path.parent.glob(f"{path.name}*") if one.is_file()]
        sound = process.returncode in (0, 2, 4) and "Traceback" not in output
        count["detected" if sound and any(one.read_text(encoding="utf-8") == "stays" for one in left) else "used"] += 1
        if path.is_file():
            path.unlink()
            away.rename(path)
        else:
            shutil.rmtree(away)
    code = place.start(["run", SCENE]).wait()
    count["used"] += code != 0 or _artifacts(store) != before
    return count


def _unfinished(folder: Path) -> list[Path]:
    """Write a piece of unfinished work as a journal leaves it; return its files."""
    import numpy as np

    journal = Journal(folder / "parts", "key")
    journal.store("piece", lambda: {"w": np.random.default_rng(1).normal(size=2000), "rows": np.ones((500, 20))})
    journal.write()
    return sorted((folder / "parts").iterdir())


def _piece(path: Path) -> Judge:
    return lambda: "detected" if Journal(path.parent, "key").find("piece") is None else "used"


def _fault(rng: random.Random, path: Path, judge: Judge, *, flip: bool) -> str:
    whole = path.read_bytes()
    offset, status = rng.randrange(len(whole)), path.stat()
    flipped = whole[:offset] + bytes([whole[offset] ^ 1 << rng.randrange(8)]) + whole[offset + 1 :]
    path.chmod(0o644)
    path.write_bytes(flipped if flip else whole[:offset])
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # bit rot does not change a file's times
    verdict = judge()
    path.write_bytes(whole)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    path.chmod(status.st_mode)
    return verdict


def _artifact(store: Store, path: Path) -> Judge:
    return lambda: "detected" if store.find(path.parent.name, path.stem) is None else "used"


def _same(read: Callable[[Path], object], path: Path) -> Judge:
    """Return a function that compares the content of a file with its content before the damage."""
    whole = read(path)
    return lambda: "detected" if (now := read(path)) is None else "harmless" if now == whole else "used"


def _kernel(path: Path) -> Judge:
    whole = read_checked(path.with_suffix(".sum"))
    return lambda: (
        "detected"
        if not is_compiled(path)
        else "harmless"
        if read_checked(path.with_suffix(".sum")) == whole
        else "used"
    )


def _kills(place: Place, verb: str, rng: random.Random, count: int) -> Counter[str]:
    """Kill a command repeatedly on the same results.

    Each killed command must leave complete files. A last command, which is not killed, must make the same results as
    one without kills, and clean up.
    """
    words, counts, results = COMMANDS[verb][1], Counter[str](), f"killed_{verb}"
    (seconds, whole), store = place.whole(words, f"whole_{verb}"), place.store(results)
    for _ in range(count):
        process = place.start(words, results)
        time.sleep(min(LATEST, seconds) * rng.random())
        process.kill()
        process.wait()
        counts["used" if maintenance.inventory(store, whole=True).damaged else "detected"] += 1
    ended = place.start(words, results).wait()
    left = [path for path in store.root.rglob("*") if path.suffix in (".tmp", ".lock", ".part")]
    if ended or left or _artifacts(store) != whole:
        counts["used"] += 1
    return counts


def _helpers(place: Place, verb: str, rng: random.Random, count: int, *, idle: bool = False) -> Counter[str]:
    """Kill one of the child processes of a command, as the system does where memory is full.

    idle: kill an idle child process, where one exists.  The command must continue without it, or end with exit code 4
    and a message; the next command must make the same results.
    """
    words, counts, label = COMMANDS[verb][1], Counter[str](), f"{verb}_{'idle' if idle else 'helped'}"
    seconds, whole = place.whole(words, f"whole_{label}")
    for k in range(count):
        results = f"helpless_{label}_{k}"
        store, process = place.store(results), place.start(words, results, stderr=subprocess.PIPE)
        end = time.monotonic() + min(LATEST, seconds) * rng.random()
        while process.poll() is None and (time.monotonic() < end or not processes.children(process.pid)):
            time.sleep(0.01)
        children = processes.children(process.pid)
        waiting = _idle(process.pid, children) if idle else children
        if not waiting:  # no fault was caused
            process.communicate()
            continue
        with suppress(psutil.NoSuchProcess):
            rng.choice(waiting).kill()
        output = process.communicate()[1].decode(errors="replace")
        intact = not maintenance.inventory(store, whole=True).damaged
        sound = process.returncode in LOST_CHILD and "Traceback" not in output and intact
        again = place.start(words, results).wait() == 0 and _artifacts(store) == whole
        if not (sound and again):
            print(f"{verb}: {process.returncode}, then {again}: {output[-500:]}", file=sys.stderr)
        counts["used" if not (sound and again) else "detected" if process.returncode else "harmless"] += 1
    return counts


def _idle(parent: int, running: Sequence[psutil.Process]) -> list[psutil.Process]:
    """Return the children of a process that use no processor time for a moment."""
    before = {child: processes.seconds_of(child) for child in running}
    time.sleep(LOOK)
    return [p for p in processes.children(parent) if p in before and processes.seconds_of(p) - before[p] < IDLE]


def _artifacts(store: Store) -> dict[tuple[str, str], str]:
    """Return the digests of computed artifacts; measured times and the batches of a sweep differ from run to run."""
    records = (read_record(path) for path in (store.root / "cache").glob("*/*.json"))
    return {(r.stage, r.key): r.digest for r in records if r is not None and r.stage in COMPUTED}


def _full(place: Place) -> Counter[str]:
    """Limit the size of files: the command must report this with exit code 4, and no partial file may remain."""
    counts = Counter[str]()
    for k, size in enumerate(FULL):
        code = place.start(["run", SCENE], f"full{k}", preexec_fn=processes.limit_files(size)).wait()
        store = place.store(f"full{k}")
        damaged = maintenance.inventory(store, whole=True).damaged if store.root.is_dir() else ()
        counts["used" if damaged or code not in (0, 4) else "detected" if code else "harmless"] += 1
    return counts


def _concurrent(place: Place) -> Counter[str]:
    """Run equal commands at once on empty results: each must end well, and together they make one complete result."""
    codes = [process.wait() for process in [place.start(["run", SCENE], "together") for _ in range(CONCURRENT)]]
    store = place.store("together")
    sound = _artifacts(store) == _artifacts(place.store()) and not maintenance.inventory(store, whole=True).damaged
    return Counter("detected" if code == 0 and sound else "used" for code in codes)


FAMILY = Family(
    what="damaged files, killed commands and helpers, full disks: what is detected, and what would be used",
    takes="20 min",
    page="reliability.md",
    cases=cases,
    measure=measure,
    show=lambda records: table(records, COLUMNS),
    rows="artifacts|compiled code|disks full|`run` killed",
    settings={"seed": 1, "flips": 200, "cuts": 50, "kills": 20},
    times=False,
    children=True,
)
