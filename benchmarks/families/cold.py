"""The first run of a scene with nothing compiled, as a command: from an empty folder of kernels to the dataset.

Meshes, modes and bundles are made before. The same command with the kernels on disk is measured next to it: the
difference is what compiling takes. Two processes compile where there are two processors. Wall time means something on a
machine without other work only; processor time is that of all processes together.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.family import Case, Family, Record, each
from benchmarks.page import Columns, short, table
from benchmarks.timing import of_children
from flexclear.pipeline.core.system.platforms import cores

SCENES = ("ideal", "csj", "far_csj_cb")


def _measured(case: Case) -> list[Record]:
    with tempfile.TemporaryDirectory() as folder:
        return [_first_run(f"sps4/{case.name}", Path(folder))]


def _first_run(scene: str, folder: Path) -> Record:
    results = folder / "results"
    kernels = [folder / name for name in ("before", "cold")]

    def run(kept: Path, *more: str) -> tuple[float, float]:
        """Seconds of wall and processor time of the command."""
        said = {"FLEXCLEAR_RESULTS": str(results), "FLEXCLEAR_KERNELS": str(kept)}
        command = [sys.executable, "-m", "flexclear", "run", scene, "-q", *more]
        begun, environment = time.monotonic(), {**os.environ, **said}
        spent = of_children(lambda: subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True))
        return time.monotonic() - begun, spent

    run(kernels[0], "--to", "bundle")
    cold = run(kernels[1], "--to", "simulate")
    shutil.rmtree(results / "cache" / "simulate")
    warm = run(kernels[1], "--to", "simulate")
    return {
        "processors": cores(),
        "wall_s": cold[0],
        "processor_s": cold[1],
        "warm_wall_s": warm[0],
        "warm_processor_s": warm[1],
        "kilobytes": sum(file.stat().st_size for file in kernels[1].rglob("*.code")) // 1000,
    }


COLUMNS: Columns = {
    "scene": lambda r: r["case"],
    "processors": lambda r: str(r["processors"]),
    "nothing compiled, wall [s]": lambda r: short(r["wall_s"]),
    "processor [s]": lambda r: short(r["processor_s"]),
    "kernels on disk, wall [s]": lambda r: short(r["warm_wall_s"]),
    "its processor [s]": lambda r: short(r["warm_processor_s"]),
    "code [kB]": lambda r: str(r["kilobytes"]),
}


FAMILY = Family(
    what="the first run of a scene, with nothing compiled",
    takes="1 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in SCENES],
    measure=each(_measured),
    show=lambda records: table(records, COLUMNS),
    children=True,
)
