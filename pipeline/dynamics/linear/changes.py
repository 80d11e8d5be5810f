"""Exact changes of forces: the kernels of the right-hand side, run on numbers with their derivatives.

Forces of one mechanism change over lengths from a millimetre (gravity, springs) to a nanometre (a contact that is just
closed). No step width fits all, and none is needed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.compile import sources
from flexclear.pipeline.dynamics.effects import Parts
from flexclear.pipeline.dynamics.linear.bench import Bench, state
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.model.interface_basis import modes_of
from flexclear.pipeline.dynamics.run.evaluation import closure_rows
from flexclear.pipeline.dynamics.run.evaluation.tree_factor import bias
from flexclear.pipeline.dynamics.specialise import dual


def force_changes(bench: Bench, q: np.ndarray, directions: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
    """Changes of bias - J^T multipliers at rest in positions q, along directions; shape (directions, nv).

    directions: changes of the state, (directions, NY).  multipliers: constant, (rows,).  Raises SolverError where the
    equations are singular.
    """
    engine, model, count = bench.engine, bench.model, len(directions)
    y = state(bench, q)
    closure_rows.evaluate(
        engine, y, bench.time
    )  # leaves the laws of time, and what each stretch holds, in the work space
    h, w = engine.h.tolist(), list(engine.w)
    w[h[m.Y] : h[m.Y] + len(y)] = dual.seeded(y, directions)
    with np.errstate(all="ignore"):  # as in compiled code, what is not used may be infinite
        _rates(model.parts)(h, list(model.arrays.f), w, engine.n.tolist(), h[m.Y], h[m.SLOPES])

    o = h[m.JACOBIAN]
    rows = selection.dense(model, engine.h, dual.changes(w[o : o + engine.lengths[m.JACOBIAN]], count))
    forces = dual.changes(bias(engine, np.array(w, dtype=object)), count)
    return (forces - multipliers @ rows) @ modes_of(model.arrays).T


@cache
def _rates(parts: Parts) -> Callable:
    scope: dict[str, Any] = {}
    exec(sources.rates(parts), scope)
    return dual.plain(scope["rates"])
