"""Whole runs of the paper's scenes: warm ones at their own tolerance, and the first one with nothing compiled.

Warm: the integration alone, and the simulate stage.  The first: as a command, from an empty folder of kernels to the
dataset; meshes, modes and bundles are made before. The same command with the kernels on disk is measured next to it:
the difference is what compiling takes. Two processes compile where there are two processors. Wall time means something
on a machine without other work only; processor time is that of all processes together.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.family import Case, Family, Measured, Record, each
from benchmarks.mechanisms import SCENES, Mechanism, mechanism
from benchmarks.page import Columns, short, spread, table
from benchmarks.timing import interleaved, of_children, once
from flexclear.pipeline import dynamics
from flexclear.pipeline.core.system.platforms import cores
from flexclear.pipeline.core.system.progress import silent
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.trajectory import integrate

ROUNDS = 5


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """A record for each scene; the scenes take turns, so that a slow minute of the machine slows all of them."""
    mechanisms = {case: mechanism(case.name) for case in cases}
    tasks: dict[str, Callable[[], float]] = {}
    evaluations: dict[str, int] = {}
    for here in mechanisms.values():
        tasks[f"{here.name} integration"], evaluations[here.name] = _integration(here)
        tasks[f"{here.name} stage"] = _stage(here)
    times = interleaved(tasks, ROUNDS)
    for case, here in mechanisms.items():
        integration = times[f"{here.name} integration"]
        record = {
            "rtol": here.scene.solver.rtol,
            "evaluations": evaluations[here.name],
            "integration": integration.record("s"),
            "stage": times[f"{here.name} stage"].record("s"),
            "us_per_evaluation": 1e6 * integration.median / evaluations[here.name],
        }
        yield case, [record]


def _integration(here: Mechanism) -> tuple[Callable[[], float], int]:
    engine = here.engine()
    start = consistent_start(engine)
    evaluations = integrate(engine, start, silent).counters["evaluations"]
    return lambda: once(lambda: integrate(engine, start, silent)), evaluations


def _stage(here: Mechanism) -> Callable[[], float]:
    return lambda: once(lambda: dynamics.simulated(here.scene, here.bundles, silent))


#: the rest of the stage is the evaluation of every recorded row, and the dataset
COLUMNS: Columns = {
    "scene": lambda r: r["case"],
    "integration [s]": lambda r: spread(r["integration"], "s", 4),
    "simulate stage [s]": lambda r: spread(r["stage"], "s", 3),
    "evaluations": lambda r: str(r["evaluations"]),
    "us per evaluation, all in": lambda r: f"{r['us_per_evaluation']:.2f}",
}


FAMILY = Family(
    what="seconds of whole warm runs of the paper's scenes",
    takes="2 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in SCENES],
    measure=measure,
    show=lambda records: table(records, COLUMNS),
    quick="ideal",
)


COLD_SCENES = ("ideal", "csj", "far_csj_cb")


def _from_nothing(case: Case) -> list[Record]:
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


COLD_COLUMNS: Columns = {
    "scene": lambda r: r["case"],
    "processors": lambda r: str(r["processors"]),
    "nothing compiled, wall [s]": lambda r: short(r["wall_s"]),
    "processor [s]": lambda r: short(r["processor_s"]),
    "kernels on disk, wall [s]": lambda r: short(r["warm_wall_s"]),
    "its processor [s]": lambda r: short(r["warm_processor_s"]),
    "code [kB]": lambda r: str(r["kilobytes"]),
}


COLD = Family(
    what="the first run of a scene, with nothing compiled",
    takes="1 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in COLD_SCENES],
    measure=each(_from_nothing),
    show=lambda records: table(records, COLD_COLUMNS),
    children=True,
)
