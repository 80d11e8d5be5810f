"""A campaign of faults: bits flipped and files cut in all that is kept, commands killed, disks full, runs side by side.

``python -m benchmarks.faults --flips 200 --cuts 50 --kills 50`` prints the tables of docs/reliability.md. A fault is
*found* when what was damaged counts as absent, *harmless* when the content is still the same (white space of a record),
and *taken* when damaged content would be used: of those there must be none. Nothing of the project's own results is
touched.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks import system
from flexclear.pipeline.core.artifacts import upkeep
from flexclear.pipeline.core.artifacts.disk import read_checked
from flexclear.pipeline.core.artifacts.store import Store, read_record
from flexclear.pipeline.core.workflow.journal import Journal, State
from flexclear.pipeline.dynamics.compile.files import CODE, compiled

SCENE = "checks/pendulum"
#: what is killed, and which share of all kills; a sweep of a scene that takes some seconds
COMMANDS = {
    "run": (0.4, ["run", SCENE, "checks/spring_pendulum"]),
    "sweep": (0.2, ["sweep", "{folder}/sweep.toml", "--workers", "2"]),
    "cost": (0.2, ["cost", SCENE, "--integrators", "dopri5"]),
    "report": (0.2, ["report", SCENE]),
}
SWEEP = """
title = "Pendulums"
scene = "checks/pendulum"
keep = ["bob.position.final"]
[vary]
"body.bob.mass" = { from = 1.0, to = 2.0, count = 400 }
"""
#: a command is killed within this time [s], or that of the whole command
LATEST = 15.0
#: file size limits, in place of full disks [B], and commands that run side by side
FULL, SIDE_BY_SIDE = (0, 200, 2_000, 8_000, 20_000, 40_000, 80_000, 200_000), 8
#: stages whose artifacts are computed, not measured
COMPUTED = ("mesh", "modes", "bundle", "simulate", "post")
Judge = Callable[[], str]


def main(arguments: list[str] | None = None) -> int:
    """Run it; the exit code is 1 when damage was taken for a result."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults")
    parser.add_argument("--flips", type=int, default=200, help="bits flipped, for each kind of file")
    parser.add_argument("--cuts", type=int, default=50, help="files cut, for each kind of file")
    parser.add_argument("--kills", type=int, default=50, help="commands killed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", choices=COMMANDS, metavar="VERB", help="only kills, and of these commands")
    options = parser.parse_args(arguments)
    if why := system.lacking():
        parser.error(why)
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="faults_") as name:
        folder = Path(name)
        (folder / "sweep.toml").write_text(SWEEP, encoding="utf-8", newline="\n")
        environment = {**os.environ, "FLEXCLEAR_RESULTS": f"{folder}/results", "FLEXCLEAR_KERNELS": f"{folder}/kernels"}
        print("| what was done | faults | found | harmless | taken |\n|---|---:|---:|---:|---:|")
        found = list[Counter[str]]()
        if not options.only:
            _run(environment)
            found += [_told(*one) for one in _damage(folder, rng, options.flips, options.cuts).items()]
            found.append(_told("disks full", _full(folder, environment)))
            found.append(_told("equal commands at once", _side_by_side(folder, environment)))
        for verb in options.only or COMMANDS:
            fraction, words = COMMANDS[verb]
            count = round(fraction * options.kills)
            found.append(_told(f"`{verb}` killed", _kills(folder, verb, words, environment, rng, count)))
    return int(any(count["taken"] for count in found))


def _told(kind: str, count: Counter[str]) -> Counter[str]:
    """Print a row."""
    row = [kind, sum(count.values()), count["found"], count["harmless"], count["taken"]]
    print("|", " | ".join(map(str, row)), "|", flush=True)
    return count


def _run(environment: dict[str, str]) -> float:
    """Bring the scene up to date; how long that took [s]."""
    begun = time.monotonic()
    subprocess.run([sys.executable, "-m", "flexclear", "run", SCENE], env=environment, check=True, capture_output=True)
    return time.monotonic() - begun


def _damage(folder: Path, rng: random.Random, flips: int, cuts: int) -> dict[str, Counter[str]]:
    """Flips and cuts in each kind of file, each mended again."""
    store = Store(folder / "results")
    records = sorted((store.root / "cache").glob("*/*.json"))
    kernels = sorted((folder / "kernels").glob("*/flexclear_*.py"))
    kinds: dict[str, list[tuple[Path, Judge]]] = {
        "artifacts": [(path.with_suffix(".nc"), _artifact(store, path)) for path in records],
        "records": [(path, _record(path)) for path in records],
        "memo of imports": [(path, _table(path)) for path in [store.root / "cache" / "imports.json"]],
        "generated sources": [(path, _kernel(path)) for path in kernels],
        "digests of kernels": [(path.with_suffix(".sum"), _kernel(path)) for path in kernels],
        "compiled code": [(path.with_suffix(CODE), _kernel(path)) for path in kernels],
    }
    kinds["unfinished work"] = [(path, _piece(path)) for path in _unfinished(folder)]
    return {
        name: Counter(_fault(rng, *rng.choice(each), flip=k < flips) for k in range(flips + cuts))
        for name, each in kinds.items()
    }


def _unfinished(folder: Path) -> list[Path]:
    """A piece of work as a journal leaves it."""
    import numpy as np

    kept = Journal(folder / "parts", "key")
    kept.write("piece", State({"w": np.random.default_rng(1).normal(size=2000)}, {"done": False}, np.ones((500, 20))))
    return sorted((folder / "parts").iterdir())


def _piece(path: Path) -> Judge:
    return lambda: "found" if Journal(path.parent, "key").find("piece") is None else "taken"


def _fault(rng: random.Random, path: Path, judge: Judge, *, flip: bool) -> str:
    whole = path.read_bytes()
    place = rng.randrange(len(whole))
    flipped = whole[:place] + bytes([whole[place] ^ 1 << rng.randrange(8)]) + whole[place + 1 :]
    path.write_bytes(flipped if flip else whole[:place])
    found = judge()
    path.write_bytes(whole)
    return found


def _artifact(store: Store, path: Path) -> Judge:
    return lambda: "found" if store.find(path.parent.name, path.stem) is None else "taken"


def _record(path: Path) -> Judge:
    whole = read_record(path)
    return lambda: "found" if (now := read_record(path)) is None else "harmless" if now == whole else "taken"


def _table(path: Path) -> Judge:
    whole = read_checked(path)
    return lambda: "found" if (now := read_checked(path)) is None else "harmless" if now == whole else "taken"


def _kernel(path: Path) -> Judge:
    whole = read_checked(path.with_suffix(".sum"))
    return lambda: (
        "found" if not compiled(path) else "harmless" if read_checked(path.with_suffix(".sum")) == whole else "taken"
    )


def _start(words: list[str], environment: dict[str, str], **more: Any) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "flexclear", *words],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **more,
    )


def _kills(
    folder: Path, verb: str, words: list[str], environment: dict[str, str], rng: random.Random, count: int
) -> Counter[str]:
    """A command killed again and again on the same results; what it leaves is whole each time, and when it is let end
    at last, what it makes is what a command makes that nobody kills."""
    words, found = [word.format(folder=folder) for word in words], Counter[str]()
    whole, begun = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/whole_{verb}"}, time.monotonic()
    assert _start(words, whole).wait() == 0
    seconds = time.monotonic() - begun
    here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/killed_{verb}"}
    store = Store(Path(here["FLEXCLEAR_RESULTS"]))
    for _ in range(count):
        process = _start(words, here)
        time.sleep(min(LATEST, seconds) * rng.random())
        process.kill()
        process.wait()
        found["taken" if upkeep.inventory(store, whole=True).damaged else "found"] += 1
    ended = _start(words, here).wait()
    left = [path for path in store.root.rglob("*") if path.suffix in (".tmp", ".lock", ".part")]
    if ended or left or _artifacts(store) != _artifacts(Store(folder / f"whole_{verb}")):
        found["taken"] += 1
    return found


def _artifacts(store: Store) -> dict[tuple[str, str], str]:
    """Digests of what is computed; measured times are others each time, and batches of a sweep are cut by the clock."""
    records = (read_record(path) for path in (store.root / "cache").glob("*/*.json"))
    return {(r.stage, r.key): r.digest for r in records if r is not None and r.stage in COMPUTED}


def _full(folder: Path, environment: dict[str, str]) -> Counter[str]:
    """No file may become longer than so many bytes: the command says so with exit code 4, and nothing half is kept."""
    found = Counter[str]()
    for k, size in enumerate(FULL):
        here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/full{k}"}
        code = _start(["run", SCENE], here, preexec_fn=system.limit_files(size)).wait()
        store = Store(Path(here["FLEXCLEAR_RESULTS"]))
        damaged = upkeep.inventory(store, whole=True).damaged if store.root.is_dir() else ()
        found["taken" if damaged or code not in (0, 4) else "found" if code else "harmless"] += 1
    return found


def _side_by_side(folder: Path, environment: dict[str, str]) -> Counter[str]:
    """Equal commands at once, on empty results: each ends well, and what they made is one and whole."""
    here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/together"}
    codes = [process.wait() for process in [_start(["run", SCENE], here) for _ in range(SIDE_BY_SIDE)]]
    store = Store(Path(here["FLEXCLEAR_RESULTS"]))
    same = _artifacts(store) == _artifacts(Store(folder / "results"))
    sound = same and not upkeep.inventory(store, whole=True).damaged
    return Counter("found" if code == 0 and sound else "taken" for code in codes)


if __name__ == "__main__":
    sys.exit(main())
