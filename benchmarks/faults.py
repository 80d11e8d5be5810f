"""A campaign of faults: damaged files, folders instead of files, killed commands and helpers, full disks.

``python -m benchmarks.faults --flips 200 --cuts 50 --kills 50`` prints the table of docs/reliability.md. With
``--minutes 10`` it begins nothing after ten minutes. A fault is *detected* when what was damaged counts as absent, or
when a command ends with an exit code of its own and a sentence. It is *harmless* when nothing is lost. It is *used*
when damaged content would be used, or a command ends with a traceback: there must be none. The project's own results
stay untouched.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import system
from flexclear.pipeline.core.artifacts import upkeep
from flexclear.pipeline.core.artifacts.disk import read_checked
from flexclear.pipeline.core.artifacts.store import Store, read_record
from flexclear.pipeline.core.workflow.journal import Journal, State
from flexclear.pipeline.dynamics.compile.files import CODE, compiled

SCENE = "checks/pendulum"
#: what is killed, and which fraction of all kills; a sweep of a scene that takes some seconds
COMMANDS = {
    "run": (0.25, ["run", SCENE, "checks/spring_pendulum"]),
    "sweep": (0.15, ["sweep", "{folder}/sweep.toml", "--workers", "2"]),
    "cost": (0.15, ["cost", SCENE, "--integrators", "dopri5"]),
    "report": (0.15, ["report", SCENE, "--answers", "none"]),
    "render": (0.1, ["render", SCENE, "--what", "motion", "--format", "png"]),
    "sections": (0.1, ["sections", "checks/driven_pendulum"]),
    "plan": (0.1, ["plan", SCENE]),
}
#: commands that have helpers, of which one is killed in their stead, and how often in proportion to their own kills
HELPED, PER_KILL = ("run", "sweep", "report"), 0.5
#: exit codes that a command may have which lost a helper: it did without, or says that its memory may be full
SAID = (0, 4)
SWEEP = """
title = "Pendulums"
scene = "checks/pendulum"
keep = ["bob.position.final"]
[vary]
"body.bob.mass" = { from = 1.0, to = 2.0, count = 400 }
"""
#: a command is killed within this time [s], or that of the whole command
LATEST = 15.0
#: file size limits, in place of full disks [B], and commands that run concurrently
FULL, CONCURRENT = (0, 200, 2_000, 8_000, 20_000, 40_000, 80_000, 200_000), 8
#: stages whose artifacts are computed, not measured
COMPUTED = ("mesh", "modes", "bundle", "simulate", "post")
Judge = Callable[[], str]


def main(arguments: list[str] | None = None) -> int:
    """Run it; the exit code is 1 when damage was used as a result."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults")
    parser.add_argument("--flips", type=int, default=200, help="bits flipped, for each kind of file")
    parser.add_argument("--cuts", type=int, default=50, help="files cut, for each kind of file")
    parser.add_argument("--kills", type=int, default=50, help="commands killed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing after so many")
    parser.add_argument("--only", nargs="+", choices=COMMANDS, metavar="VERB", help="only kills, and of these commands")
    options = parser.parse_args(arguments)
    if why := system.lacking():
        parser.error(why)
    rng, end = random.Random(options.seed), time.monotonic() + 60.0 * options.minutes
    with tempfile.TemporaryDirectory(prefix="faults_") as name:
        folder = Path(name)
        (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8", newline="\n")
        environment = {**os.environ, "FLEXCLEAR_RESULTS": f"{folder}/results", "FLEXCLEAR_KERNELS": f"{folder}/kernels"}
        print("| fault in | faults | detected | harmless | used |\n|---|---:|---:|---:|---:|")
        rows = list[Counter[str]]()
        for kind, judge in _campaign(folder, environment, rng, options):
            if time.monotonic() < end:
                rows.append(_printed(kind, judge()))
    return int(any(count["used"] for count in rows))


def _campaign(
    folder: Path, environment: dict[str, str], rng: random.Random, options: argparse.Namespace
) -> Iterator[tuple[str, Callable[[], Counter[str]]]]:
    """Kinds of faults, and what brings about so many of each and counts what became of them."""
    if not options.only:
        _run(environment)
        for kind, files in _damaged(folder).items():
            yield kind, partial(_damage, rng, files, options.flips, options.cuts)
        yield "folders instead of files", partial(_folders, folder, environment)
        yield "disks full (files of at most so many bytes)", partial(_full, folder, environment)
        yield "equal commands at once", partial(_concurrent, folder, environment)
    for verb in options.only or COMMANDS:
        fraction, words = COMMANDS[verb]
        count = max(1, round(fraction * options.kills))
        yield f"`{verb}` killed", partial(_kills, folder, verb, words, environment, rng, count)
        if verb in HELPED:
            helpers = max(1, round(PER_KILL * count))
            yield f"helpers of `{verb}` killed", partial(_helpers, folder, verb, words, environment, rng, helpers)


def _printed(kind: str, count: Counter[str]) -> Counter[str]:
    """Print a row."""
    row = [kind, sum(count.values()), count["detected"], count["harmless"], count["used"]]
    print("|", " | ".join(map(str, row)), "|", flush=True)
    return count


def _run(environment: dict[str, str]) -> float:
    """Bring the scene up to date; how long that took [s]."""
    begun = time.monotonic()
    subprocess.run([sys.executable, "-m", "flexclear", "run", SCENE], env=environment, check=True, capture_output=True)
    return time.monotonic() - begun


def _damaged(folder: Path) -> dict[str, list[tuple[Path, Judge]]]:
    """Each kind of file, and for each what says whether damage to it is detected."""
    store = Store(folder / "results")
    records = sorted((store.root / "cache").glob("*/*.json"))
    kernels = sorted((folder / "kernels").glob("*/flexclear_*.py"))
    shown = sorted((store.root / "runs").rglob("*.nc"))
    return {
        "artifacts": [(path.with_suffix(".nc"), _artifact(store, path)) for path in records],
        "records": [(path, _record(path)) for path in records],
        "shown files": [(path, partial(_shown, store)) for path in shown],
        "memo of imports": [(path, _table(path)) for path in [store.root / "cache" / "imports.json"]],
        "generated sources": [(path, _kernel(path)) for path in kernels],
        "digests of kernels": [(path.with_suffix(".sum"), _kernel(path)) for path in kernels],
        "compiled code": [(path.with_suffix(CODE), _kernel(path)) for path in kernels],
        "unfinished work": [(path, _piece(path)) for path in _unfinished(folder)],
    }


def _damage(rng: random.Random, files: list[tuple[Path, Judge]], flips: int, cuts: int) -> Counter[str]:
    """Flips and cuts in one kind of file, each file restored afterwards."""
    return Counter(_fault(rng, *rng.choice(files), flip=k < flips) for k in range(flips + cuts))


def _shown(store: Store) -> str:
    return "detected" if upkeep.shown_faults(store, store.root / "runs") else "used"


def _folders(folder: Path, environment: dict[str, str]) -> Counter[str]:
    """A folder instead of each file of a run in turn: it is renamed, and the same result is shown."""
    store, count = Store(folder / "results"), Counter[str]()
    before = _artifacts(store)
    cached = [
        path for suffix in ("nc", "json", "names") for path in sorted((store.root / "cache").glob(f"*/*.{suffix}"))
    ]
    shown = sorted((store.root / "runs").rglob("*.nc"))
    for path in [*cached, *shown, store.root / "cache" / "imports.json"]:
        path.unlink(missing_ok=True)
        path.mkdir()
        (path / "mine").write_text("stays", encoding="utf-8")
        code = _start(["run", SCENE], environment).wait()
        lost = not any(left.read_text(encoding="utf-8") == "stays" for left in path.parent.glob(f"{path.name}*/mine"))
        sound = code == 0 and not lost and _artifacts(store) == before and _shown(store) == "used"
        count["detected" if sound else "used"] += 1
    return count


def _unfinished(folder: Path) -> list[Path]:
    """A piece of work as a journal leaves it."""
    import numpy as np

    journal = Journal(folder / "parts", "key")
    journal.write(
        "piece", State({"w": np.random.default_rng(1).normal(size=2000)}, {"done": False}, np.ones((500, 20)))
    )
    return sorted((folder / "parts").iterdir())


def _piece(path: Path) -> Judge:
    return lambda: "detected" if Journal(path.parent, "key").find("piece") is None else "used"


def _fault(rng: random.Random, path: Path, judge: Judge, *, flip: bool) -> str:
    whole = path.read_bytes()
    offset, status = rng.randrange(len(whole)), path.stat()
    flipped = whole[:offset] + bytes([whole[offset] ^ 1 << rng.randrange(8)]) + whole[offset + 1 :]
    path.chmod(0o644)
    path.write_bytes(flipped if flip else whole[:offset])
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # bit rot changes no time
    verdict = judge()
    path.write_bytes(whole)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    path.chmod(status.st_mode)
    return verdict


def _artifact(store: Store, path: Path) -> Judge:
    return lambda: "detected" if store.find(path.parent.name, path.stem) is None else "used"


def _same(read: Callable[[Path], object], path: Path) -> Judge:
    """Compare what is read from a file with what was read from it before the damage."""
    whole = read(path)
    return lambda: "detected" if (now := read(path)) is None else "harmless" if now == whole else "used"


def _record(path: Path) -> Judge:
    return _same(read_record, path)


def _table(path: Path) -> Judge:
    return _same(read_checked, path)


def _kernel(path: Path) -> Judge:
    whole = read_checked(path.with_suffix(".sum"))
    return lambda: (
        "detected" if not compiled(path) else "harmless" if read_checked(path.with_suffix(".sum")) == whole else "used"
    )


def _start(words: list[str], environment: dict[str, str], **more: Any) -> subprocess.Popen[bytes]:
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "flexclear", *words], env=environment, **{**silent, **more})


def _kills(
    folder: Path, verb: str, words: list[str], environment: dict[str, str], rng: random.Random, count: int
) -> Counter[str]:
    """A command killed repeatedly on the same results.

    What it leaves is complete each time. The last command, which nobody kills, makes the same results as one without
    kills, and cleans up.
    """
    words, counts = [word.format(folder=folder) for word in words], Counter[str]()
    seconds, whole = _whole(folder, verb, words, environment)
    here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/killed_{verb}"}
    store = Store(Path(here["FLEXCLEAR_RESULTS"]))
    for _ in range(count):
        process = _start(words, here)
        time.sleep(min(LATEST, seconds) * rng.random())
        process.kill()
        process.wait()
        counts["used" if upkeep.inventory(store, whole=True).damaged else "detected"] += 1
    ended = _start(words, here).wait()
    left = [path for path in store.root.rglob("*") if path.suffix in (".tmp", ".lock", ".part")]
    if ended or left or _artifacts(store) != _artifacts(whole):
        counts["used"] += 1
    return counts


def _whole(folder: Path, verb: str, words: list[str], environment: dict[str, str]) -> tuple[float, Store]:
    """How long the command takes on empty results that nobody disturbs [s], and what it makes."""
    results, begun = folder / f"whole_{verb}", time.monotonic()
    code = _start(words, {**environment, "FLEXCLEAR_RESULTS": str(results)}).wait()
    assert code == 0, f"{verb} ends with {code}"
    return time.monotonic() - begun, Store(results)


def _helpers(
    folder: Path, verb: str, words: list[str], environment: dict[str, str], rng: random.Random, count: int
) -> Counter[str]:
    """One of the processes that a command has started is killed, as the system does where memory is full.

    The command does without it, or ends with exit code 4 and a sentence; the next one makes the same results.
    """
    words, counts = [word.format(folder=folder) for word in words], Counter[str]()
    seconds, whole = _whole(folder, f"{verb}_helped", words, environment)
    for k in range(count):
        here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/helpless_{verb}_{k}"}
        store = Store(Path(here["FLEXCLEAR_RESULTS"]))
        process = _start(words, here, stderr=subprocess.PIPE)
        end = time.monotonic() + min(LATEST, seconds) * rng.random()
        while process.poll() is None and (time.monotonic() < end or not system.children(process.pid)):
            time.sleep(0.01)
        children = system.children(process.pid)
        if children:
            os.kill(rng.choice(children), signal.SIGKILL)
        said = process.communicate()[1].decode(errors="replace")
        sound = (
            process.returncode in SAID and "Traceback" not in said and not upkeep.inventory(store, whole=True).damaged
        )
        again = _start(words, here).wait() == 0 and _artifacts(store) == _artifacts(whole)
        if not (sound and again):
            print(f"{verb}: {process.returncode}, then {again}: {said[-500:]}", file=sys.stderr)
        counts["used" if not (sound and again) else "detected" if process.returncode else "harmless"] += 1
    return counts


def _artifacts(store: Store) -> dict[tuple[str, str], str]:
    """Digests of what is computed; measured times are others each time, and batches of a sweep are cut by the clock."""
    records = (read_record(path) for path in (store.root / "cache").glob("*/*.json"))
    return {(r.stage, r.key): r.digest for r in records if r is not None and r.stage in COMPUTED}


def _full(folder: Path, environment: dict[str, str]) -> Counter[str]:
    """No file may be longer than so many bytes: the command says so with exit code 4, and no partial file remains."""
    counts = Counter[str]()
    for k, size in enumerate(FULL):
        here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/full{k}"}
        code = _start(["run", SCENE], here, preexec_fn=system.limit_files(size)).wait()
        store = Store(Path(here["FLEXCLEAR_RESULTS"]))
        damaged = upkeep.inventory(store, whole=True).damaged if store.root.is_dir() else ()
        counts["used" if damaged or code not in (0, 4) else "detected" if code else "harmless"] += 1
    return counts


def _concurrent(folder: Path, environment: dict[str, str]) -> Counter[str]:
    """Equal commands at once, on empty results: each ends well, and together they make one complete result."""
    here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/together"}
    codes = [process.wait() for process in [_start(["run", SCENE], here) for _ in range(CONCURRENT)]]
    store = Store(Path(here["FLEXCLEAR_RESULTS"]))
    same = _artifacts(store) == _artifacts(Store(folder / "results"))
    sound = same and not upkeep.inventory(store, whole=True).damaged
    return Counter("detected" if code == 0 and sound else "used" for code in codes)


if __name__ == "__main__":
    sys.exit(main())
