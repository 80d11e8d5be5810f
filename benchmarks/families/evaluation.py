"""One evaluation of the right-hand side against one LAPACK ``dgesv`` of the maximal-coordinate system."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.linalg.lapack import dgesv

from benchmarks import maximal
from benchmarks.family import Case, Family, Record, each
from benchmarks.mechanisms import SCENES, evaluation_time, mechanism, states, trajectory
from benchmarks.page import spread
from benchmarks.timing import interleaved, once
from flexclear.pipeline.post.plotting.table import pipe_table

#: of a round, some milliseconds each: short against the drift of the machine, long against the clock
EVALUATIONS, SOLUTIONS, ROUNDS = 2000, 30, 25


def _scene(case: Case) -> list[Record]:
    """Both in turns in one process, the ratio the median of the ratios of neighbours."""
    here = mechanism(case.name)
    engines = {"": here.general_engine(), ", straight": here.engine()}
    system = maximal.assemble(here.scene, here.bundles)
    tasks: dict[str, Callable[[], float]] = {"dgesv": dgesv_time(system)}
    straight = engines[", straight"]
    for label, state in states(straight, trajectory(straight)).items():
        for way, engine in engines.items():
            tasks[f"{label}{way}"] = partial(evaluation_time, engine, state, EVALUATIONS)
    times = interleaved(tasks, ROUNDS)
    dense = times.pop("dgesv")
    ours = {label: found.record("us") | {"ratio": dense.over(found)} for label, found in times.items()}
    count = {"unknowns": system.count.unknowns, "derivation": system.count.derivation()}
    return [{**count, "dgesv": dense.record("us"), "ours": ours}]


def dgesv_time(system: maximal.Maximal) -> Callable[[], float]:
    """A measurement of one solution of a dense system [s]; assembling it is not counted, nor are copies."""
    matrix, right = np.asfortranarray(system.matrix), system.right_side

    def task() -> float:
        copies = [(matrix.copy(order="F"), right.copy()) for _ in range(SOLUTIONS)]

        def solve() -> None:
            for A, b in copies:
                dgesv(A, b, overwrite_a=1, overwrite_b=1)

        return once(solve) / SOLUTIONS

    return task


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
