"""One evaluation of the right-hand side against one LAPACK ``dgesv`` of the maximal-coordinate system.

Both are measured in turns in one process on one thread, and the ratio is the median of the ratios of neighbours.
What favours ``dgesv``: assembling its matrix is not counted, and nor are copies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgesv

from benchmarks import maximal
from benchmarks.engines import SCENES, evaluation_time, mechanism, states, trajectory
from benchmarks.measure import Times, interleaved, once
from benchmarks.tables import percent, table

TITLE = "Microseconds per evaluation of the right-hand side"
#: of a round, some milliseconds each: short against the drift of the machine, long against the clock
EVALUATIONS, SOLUTIONS, ROUNDS = 2000, 30, 25


def measure() -> Iterator[dict[str, Any]]:
    """One result per scene of the paper."""
    for name in SCENES:
        yield _scene(name)


def _scene(name: str) -> dict[str, Any]:
    here = mechanism(name)
    engine = here.engine()
    system = maximal.assemble(here.scene, here.bundles)
    tasks: dict[str, Callable[[], float]] = {"dgesv": dgesv_time(system)}
    for label, state in states(engine, trajectory(engine)).items():
        tasks[label] = lambda state=state: evaluation_time(engine, state, EVALUATIONS)  # type: ignore[misc]
    times = interleaved(tasks, ROUNDS)
    return {
        "scene": name,
        "unknowns": system.count.unknowns,
        "derivation": system.count.derivation(),
        "dgesv": _summary(times["dgesv"]),
        "ours": {
            label: _summary(found) | {"ratio": times["dgesv"].over(found)}
            for label, found in times.items()
            if label != "dgesv"
        },
    }


def dgesv_time(system: maximal.Maximal) -> Callable[[], float]:
    """A measurement of one solution of a dense system [s]; copies are made beforehand."""
    matrix, right = np.asfortranarray(system.matrix), system.right_side

    def task() -> float:
        copies = [(matrix.copy(order="F"), right.copy()) for _ in range(SOLUTIONS)]

        def solve() -> None:
            for A, b in copies:
                dgesv(A, b, overwrite_a=1, overwrite_b=1)

        return once(solve) / SOLUTIONS

    return task


def _summary(times: Times) -> dict[str, float]:
    return {"us": 1e6 * times.median, "spread": times.spread}


def show(results: list[dict[str, Any]]) -> str:
    """The table, and where the numbers of unknowns come from."""
    rows = []
    for r in results:
        cells = [r["scene"], str(r["unknowns"]), f"{r['dgesv']['us']:.1f} ± {percent(r['dgesv']['spread'])}"]
        for label in ("free", "in contact"):
            ours = r["ours"].get(label)
            cells += [f"{ours['us']:.2f} ± {percent(ours['spread'])}", f"1/{ours['ratio']:.1f}"] if ours else ["", ""]
        rows.append(cells)
    head = ("scene", "n", "dgesv(n) [us]", "free [us]", "of dgesv", "in contact [us]", "of dgesv")
    derivations = "\n".join(f"- {r['scene']}: n = {r['derivation']}" for r in results)
    return f"{table(head, rows)}\n\n{derivations}"
