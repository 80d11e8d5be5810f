"""Evaluations and whole runs of the paper's scenes: warm, and the first run with nothing compiled.

Evaluations are compared with one LAPACK ``dgesv`` of the order of the maximal-coordinate system.

Warm runs: the integration alone, and the simulate stage.  First runs: the command from an empty folder of kernels to
the dataset; meshes, modes, bundles and Python's bytecode, which installing writes, exist before. The same command runs
again with all kernels on disk: the difference is the time of compiling. A third run lacks only the kernels of the
scene's own topology, as does the first mechanism with another topology. Two processes compile where two processors
exist. Wall time is meaningful only on a machine without other work; processor time is the sum over all processes.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.linalg.lapack import dgesv

from benchmarks.family import Case, Family, Measured, Record, each
from benchmarks.mechanisms import SCENES, Mechanism, evaluation_time, mechanism, states, trajectory
from benchmarks.page import Columns, short, spread, table
from benchmarks.processes import as_installed
from benchmarks.timing import interleaved, of_children, once
from flexclear import dynamics
from flexclear.dynamics.compile.sources import SPECIALISED
from flexclear.dynamics.model.merge import frames_of, merge
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.trajectory import integrate
from flexclear.post.plotting.table import pipe_table
from flexclear.scene.schema import Scene
from flexclear.system.platforms import count_cores
from flexclear.system.progress import silent

ROUNDS = 5


def measure(cases: Sequence[Case], jobs: int) -> Measured:
    """Yield a record for each scene; the scenes take turns, so that a slow minute of the machine slows all of them."""
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


#: the stage also evaluates every recorded row and makes the dataset
COLUMNS: Columns = {
    "scene": lambda r: r["case"],
    "integration [s]": lambda r: spread(r["integration"], "s", 4),
    "simulate stage [s]": lambda r: spread(r["stage"], "s", 3),
    "evaluations": lambda r: str(r["evaluations"]),
    "integration per evaluation [us]": lambda r: f"{r['us_per_evaluation']:.2f}",
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
    results, kernels = folder / "results", folder / "kernels"

    def run(kernels: Path) -> tuple[float, float]:
        """Return wall and processor time of the command [s]; the dataset of an earlier run is deleted first."""
        shutil.rmtree(results / "cache" / "simulate", ignore_errors=True)
        command = [sys.executable, "-m", "flexclear", "run", scene, "-q", "--to", "simulate"]
        begun, environment = time.monotonic(), {**as_installed(folder), "FLEXCLEAR_KERNELS": str(kernels)}
        spent = of_children(lambda: subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True))
        return time.monotonic() - begun, spent

    run(folder / "before")
    cold, warm = run(kernels), run(kernels)
    for file in kernels.rglob(f"flexclear_{SPECIALISED}_*"):
        file.unlink()
    other = run(kernels)
    return {
        "processors": count_cores(),
        "wall_s": cold[0],
        "processor_s": cold[1],
        "warm_wall_s": warm[0],
        "warm_processor_s": warm[1],
        "another_wall_s": other[0],
        "kilobytes": sum(file.stat().st_size for file in kernels.rglob("*.code")) // 1000,
    }


COLD_COLUMNS: Columns = {
    "scene": lambda r: r["case"],
    "processors": lambda r: str(r["processors"]),
    "nothing compiled, wall [s]": lambda r: short(r["wall_s"]),
    "processor [s]": lambda r: short(r["processor_s"]),
    "kernels on disk, wall [s]": lambda r: short(r["warm_wall_s"]),
    "warm processor [s]": lambda r: short(r["warm_processor_s"]),
    "another topology, wall [s]": lambda r: short(r["another_wall_s"]),
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


#: counts per round, some milliseconds each: short against the machine's drift, long against the clock; and rounds
EVALUATIONS, SOLUTIONS, TURNS = 2000, 30, 25
#: constraint rows of a joint in maximal coordinates; a fixed joint merges two bodies into one link
JOINT_ROWS = {"spherical": 3, "revolute": 5, "prismatic": 5, "fixed": 0, "clearance-spherical": 0}


def _evaluations(case: Case) -> list[Record]:
    """Return the times of both, in turns in one process; a ratio is the median of the ratios of neighbours."""
    here = mechanism(case.name)
    engines = {"": here.general_engine(), ", straight": here.engine()}
    unknowns, derivation = maximal_unknowns(here.scene, here.bundles)
    tasks: dict[str, Callable[[], float]] = {"dgesv": partial(dgesv_time, unknowns)}
    straight = engines[", straight"]
    for label, state in states(straight, trajectory(straight)).items():
        for way, engine in engines.items():
            tasks[f"{label}{way}"] = partial(evaluation_time, engine, state, EVALUATIONS)
    times = interleaved(tasks, TURNS)
    dense = times.pop("dgesv")
    ours = {label: found.record("us") | {"ratio": dense.over(found)} for label, found in times.items()}
    return [{"unknowns": unknowns, "derivation": derivation, "dgesv": dense.record("us"), "ours": ours}]


def maximal_unknowns(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> tuple[int, str]:
    """Return the order of the system in maximal coordinates, and its derivation in words.

    The unknowns are the accelerations of every moving link (6 each; rigidly joined bodies are one link, also where one
    of them is flexible), those of the modes, and one multiplier for each row of every joint, drives included. Joints
    with clearance are forces and have no rows.
    """
    frames = frames_of(scene, bundles)
    groups, group_of = merge(scene, frames)
    # rigid groups that a fixed joint ties to a flexible one move with the frame of that body
    tied = [
        {group_of[frames[f].body] for f in joint.between} for joint in scene.joint.values() if joint.type == "fixed"
    ]
    carried = {i for pair in tied if len(pair) == 2 for i in pair if not groups[i].flexible}
    links = len(groups) - 1 - len(carried)
    modes = sum(bundles[group.host].sizes["mode"] for group in groups if group.flexible)
    rows = sum(JOINT_ROWS[joint.type] for joint in scene.joint.values())
    unknowns = 6 * links + modes + rows + len(scene.drive)
    of_modes = f" + {modes} modes" if modes else ""
    return unknowns, f"6 x {links} links{of_modes} + {rows} joint rows + {len(scene.drive)} drive rows = {unknowns}"


def dgesv_time(order: int) -> float:
    """Return the processor time of one solution of a dense system [s], without making the matrix.

    The matrix is random: its entries change the time by less than 2 %.
    """
    random = np.random.default_rng(order)
    systems = [(random.normal(size=(order, order)).T, random.normal(size=order)) for _ in range(SOLUTIONS)]

    def solve() -> None:
        for A, b in systems:
            dgesv(A, b, overwrite_a=1, overwrite_b=1)

    return once(solve) / SOLUTIONS


def shown_evaluations(records: list[Record]) -> str:
    """Return the table, and the derivation of the last number of unknowns."""
    rows = []
    for r in records:
        cells = [r["case"], str(r["unknowns"]), spread(r["dgesv"], "us", 1)]
        for label in ("free, straight", "in contact, straight", "free", "in contact"):
            ours = r["ours"].get(label)
            cells += [spread(ours, "us", 2), f"1/{ours['ratio']:.1f}"] if ours else ["", ""]
        rows.append(cells)
    head = ["scene", "n", "dgesv(n) [us]"]
    for label in ("free", "in contact", "list, free", "list, in contact"):
        head += [f"{label} [us]", "of dgesv"]
    return f"{pipe_table(head, rows)}\n\n{records[-1]['case']}: n = {records[-1]['derivation']}."


EVALUATION = Family(
    what="microseconds of one evaluation, against a dense solve",
    takes="1 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in SCENES],
    measure=each(_evaluations),
    show=shown_evaluations,
    quick="ideal",
)
