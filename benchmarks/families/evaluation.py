"""One evaluation of the right-hand side against one LAPACK ``dgesv`` of the order of the maximal-coordinate system.

Its unknowns are the accelerations of every moving link (6 each, rigidly joined bodies being one, also where one of them
is flexible), those of the modes, and one multiplier for each row of every joint, drives included. Joints with clearance
are forces and have no rows. The matrix is a random one: to within 2 % its entries do not matter for the time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import xarray as xr
from scipy.linalg.lapack import dgesv

from benchmarks.family import Case, Family, Record, each
from benchmarks.mechanisms import SCENES, evaluation_time, mechanism, states, trajectory
from benchmarks.page import spread
from benchmarks.timing import interleaved, once
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics.model.merge import frames_of, merge
from flexclear.pipeline.post.plotting.table import pipe_table

#: of a round, some milliseconds each: short against the drift of the machine, long against the clock
EVALUATIONS, SOLUTIONS, ROUNDS = 2000, 30, 25
#: rows of a joint in maximal coordinates; a fixed one joins two bodies to one link
ROWS = {"spherical": 3, "revolute": 5, "prismatic": 5, "fixed": 0, "clearance-spherical": 0}


def _scene(case: Case) -> list[Record]:
    """Both in turns in one process, the ratio the median of the ratios of neighbours."""
    here = mechanism(case.name)
    engines = {"": here.general_engine(), ", straight": here.engine()}
    unknowns, derivation = maximal_unknowns(here.scene, here.bundles)
    tasks: dict[str, Callable[[], float]] = {"dgesv": partial(dgesv_time, unknowns)}
    straight = engines[", straight"]
    for label, state in states(straight, trajectory(straight)).items():
        for way, engine in engines.items():
            tasks[f"{label}{way}"] = partial(evaluation_time, engine, state, EVALUATIONS)
    times = interleaved(tasks, ROUNDS)
    dense = times.pop("dgesv")
    ours = {label: found.record("us") | {"ratio": dense.over(found)} for label, found in times.items()}
    return [{"unknowns": unknowns, "derivation": derivation, "dgesv": dense.record("us"), "ours": ours}]


def maximal_unknowns(scene: Scene, bundles: Mapping[str, xr.Dataset]) -> tuple[int, str]:
    """Order of the system in maximal coordinates, and where it comes from in words."""
    frames = frames_of(scene, bundles)
    groups, group_of = merge(scene, frames)
    # rigid groups that a fixed joint ties to a flexible one move with its frame
    tied = [
        {group_of[frames[f].body] for f in joint.between} for joint in scene.joint.values() if joint.type == "fixed"
    ]
    carried = {i for pair in tied if len(pair) == 2 for i in pair if not groups[i].flexible}
    links = len(groups) - 1 - len(carried)
    modes = sum(bundles[group.host].sizes["mode"] for group in groups if group.flexible)
    rows = sum(ROWS[joint.type] for joint in scene.joint.values())
    unknowns = 6 * links + modes + rows + len(scene.drive)
    of_modes = f" + {modes} modes" if modes else ""
    return unknowns, f"6 x {links} links{of_modes} + {rows} joint rows + {len(scene.drive)} drive rows = {unknowns}"


def dgesv_time(order: int) -> float:
    """Processor time of one solution of a dense system [s]; making its matrix is not counted."""
    random = np.random.default_rng(order)
    systems = [(random.normal(size=(order, order)).T, random.normal(size=order)) for _ in range(SOLUTIONS)]

    def solve() -> None:
        for A, b in systems:
            dgesv(A, b, overwrite_a=1, overwrite_b=1)

    return once(solve) / SOLUTIONS


def show(records: list[Record]) -> str:
    """The table, and where the numbers of unknowns come from."""
    rows = []
    for r in records:
        cells = [r["case"], str(r["unknowns"]), spread(r["dgesv"], "us", 1)]
        for label in ("free, straight", "in contact, straight", "free", "in contact"):
            ours = r["ours"].get(label)
            cells += [spread(ours, "us", 2), f"1/{ours['ratio']:.1f}"] if ours else ["", ""]
        rows.append(cells)
    head = ["scene", "n", "dgesv(n) [us]"]
    for label in ("free", "in contact", "kernels, free", "kernels, in contact"):
        head += [f"{label} [us]", "of dgesv"]
    derivations = "\n".join(f"- {r['case']}: n = {r['derivation']}" for r in records)
    return f"{pipe_table(head, rows)}\n\n{derivations}"


FAMILY = Family(
    what="microseconds of one evaluation, against a dense solve",
    takes="1 min",
    page="benchmarks.md",
    cases=lambda: [Case(name) for name in SCENES],
    measure=each(_scene),
    show=show,
    quick="ideal",
)
