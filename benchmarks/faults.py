"""A campaign of faults: bits flipped and files cut in all that is kept, commands killed at random moments.

``python -m benchmarks.faults --flips 200 --kills 20`` prints the table of docs/reliability.md. A fault is *found* when
what was damaged counts as absent, *harmless* when the content is still the same (white space of a record), and *taken*
when damaged content would be used: of those there must be none. Nothing of the project's own results is touched.
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

from flexclear.pipeline.core.artifacts import upkeep
from flexclear.pipeline.core.artifacts.disk import read_checked
from flexclear.pipeline.core.artifacts.store import Store, read_record
from flexclear.pipeline.dynamics.compile.files import compiled

SCENE = "checks/pendulum"
#: by which share of a whole run a command is killed
LATEST = 1.2
Judge = Callable[[], str]


def main(arguments: list[str] | None = None) -> int:
    """Run it; the exit code is 1 when damage was taken for a result."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults")
    parser.add_argument("--flips", type=int, default=200, help="faults for each kind of file")
    parser.add_argument("--kills", type=int, default=20, help="commands killed")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory(prefix="faults_") as folder:
        environment = {**os.environ, "FLEXCLEAR_RESULTS": f"{folder}/results", "FLEXCLEAR_KERNELS": f"{folder}/kernels"}
        seconds = _run(environment)
        found = _damage(Path(folder), rng, options.flips)
        found["commands killed"] = _kills(Path(folder), environment, rng, options.kills, seconds)
    print("| what was damaged | faults | found | harmless | taken |\n|---|---:|---:|---:|---:|")
    for name, count in found.items():
        print(f"| {name} | {sum(count.values())} | {count['found']} | {count['harmless']} | {count['taken']} |")
    return int(any(count["taken"] for count in found.values()))


def _run(environment: dict[str, str]) -> float:
    """Bring the scene up to date; how long that took [s]."""
    begun = time.monotonic()
    subprocess.run([sys.executable, "-m", "flexclear", "run", SCENE], env=environment, check=True, capture_output=True)
    return time.monotonic() - begun


def _damage(folder: Path, rng: random.Random, count: int) -> dict[str, Counter[str]]:
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
        "index of the compiler": [(p, _kernel(k)) for k in kernels for p in k.parent.rglob(f"{k.stem}*.nbi")],
        "compiled code": [(p, _kernel(k)) for k in kernels for p in k.parent.rglob(f"{k.stem}*.nbc")],
    }
    return {name: Counter(_fault(rng, *rng.choice(each)) for _ in range(count)) for name, each in kinds.items()}


def _fault(rng: random.Random, path: Path, judge: Judge) -> str:
    whole = path.read_bytes()
    place = rng.randrange(len(whole))
    flipped = whole[:place] + bytes([whole[place] ^ 1 << rng.randrange(8)]) + whole[place + 1 :]
    path.write_bytes(flipped if rng.random() < 0.7 else whole[:place])
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


def _kills(folder: Path, environment: dict[str, str], rng: random.Random, count: int, seconds: float) -> Counter[str]:
    """Commands killed while they bring an empty results folder up to date; what they left is whole, and swept next."""
    found: Counter[str] = Counter()
    for k in range(count):
        here = {**environment, "FLEXCLEAR_RESULTS": f"{folder}/killed{k}"}
        process = subprocess.Popen(
            [sys.executable, "-m", "flexclear", "run", SCENE],
            env=here,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        time.sleep(LATEST * seconds * rng.random())
        process.kill()
        process.wait()
        store = Store(Path(here["FLEXCLEAR_RESULTS"]))
        damaged = upkeep.inventory(store, whole=True).damaged
        _run(here)
        left = [path for path in store.root.rglob("*") if path.suffix in (".tmp", ".lock")]
        found["taken" if damaged or left else "found"] += 1
    return found


if __name__ == "__main__":
    sys.exit(main())
