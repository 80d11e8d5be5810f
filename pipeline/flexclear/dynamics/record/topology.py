"""Mobility, rank and condition along a run, its passes through singular poses, and redundant reactions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics.equations.observation import Observed, Series, Variables
from flexclear.dynamics.model import selection
from flexclear.dynamics.model.mobility import INFINITE
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.run import Run
from flexclear.dynamics.run.trajectory import Trajectory

#: condition numbers below this leave no doubt about a row's rank, in any units, and leave ten digits to the eigenvalues
#: of J J^T, the squares of the singular values: their roundings are 1e-16 of the largest one
WELL_CONDITIONED = 1e3
#: number of rows examined together: allocating the matrices of all rows takes longer than the computation
ROWS_AT_ONCE = 256


def topology(run: Run) -> Series:
    """Return rank, mobility, condition, singular passes and redundant reactions for the run dataset."""
    engine, trajectory, seen = run.engine, run.trajectory, run.observed
    redundant = np.array([name in engine.mobility.redundant_joints for name in run.scene.joint], dtype=np.int8)
    variables: Variables = {"reaction_redundant": (("joint",), redundant)}
    rows, nv = len(trajectory.rows), engine.model.nv
    indicators = _singular_values(engine, trajectory, seen, closure_rows.scale_rows)
    rank = np.full(rows, indicators.shape[1], dtype=np.int32)
    if indicators.shape[1]:
        least = np.maximum(indicators[:, -1], indicators[:, 0] / INFINITE)
        condition = variables["condition"] = (("time",), np.minimum(indicators[:, 0] / least, INFINITE))
        singular_rows = condition[1] > WELL_CONDITIONED
        if singular_rows.any():
            values = _singular_values(engine, trajectory, seen, closure_rows.natural)[singular_rows]
            # singular values of the selected closure rows below this fraction of the largest count as zero in the rank
            rank[singular_rows] = np.sum(values > 1e-9 * values[:, :1], axis=1)
    variables["rank"] = (("time",), rank)
    variables["mobility"] = (("time",), (nv - rank).astype(np.int32))
    if not indicators.shape[1]:
        return variables, {}
    passes = trajectory.passes
    variables |= {
        "pass_time": (("singular_pass",), np.array([p.time for p in passes])),
        "pass_condition": (("singular_pass",), np.array([p.condition for p in passes])),
        "pass_rank_loss": (("singular_pass",), np.array([p.lost for p in passes], dtype=np.int32)),
    }
    return variables, {"pass_joint": ("singular_pass", np.array([p.joint for p in passes], dtype=str))}


def _singular_values(
    engine: Engine, trajectory: Trajectory, seen: Observed, scale: Callable[..., np.ndarray]
) -> np.ndarray:
    """Return the singular values of every row's Jacobian of the selected closure rows; shape (time, rank)."""
    parts = []
    for part, selected in trajectory.parts():
        engine.keep(selected)
        stored = seen.jacobian[part]
        for first in range(0, max(len(stored), 1), ROWS_AT_ONCE):
            J = selection.dense_rows(engine.model, engine.h, stored[first : first + ROWS_AT_ONCE])
            parts.append(_values(scale(engine.model, engine.h, J)))
    return np.concatenate(parts)


def _values(J: np.ndarray) -> np.ndarray:
    """Return the singular values of matrices (..., rank, nv), largest first."""
    if not J.size:
        return np.zeros(J.shape[:2])
    squares = np.linalg.eigvalsh(J @ np.swapaxes(J, 1, 2))[:, ::-1]
    values = np.sqrt(np.maximum(squares, 0.0))
    poor = ~(values[:, -1] * WELL_CONDITIONED > values[:, 0])
    if poor.any():
        values[poor] = np.linalg.svd(J[poor], compute_uv=False)
    return values
