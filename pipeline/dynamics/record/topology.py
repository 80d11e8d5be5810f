"""Mobility, rank and condition along a run, its passes through singular poses, and redundant reactions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model import selection
from flexclear.pipeline.dynamics.model.mobility import INFINITE
from flexclear.pipeline.dynamics.run import singular
from flexclear.pipeline.dynamics.run.engine import Engine
from flexclear.pipeline.dynamics.run.run import Run
from flexclear.pipeline.dynamics.run.trajectory import Trajectory

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]

#: singular values of the kept closure rows below this share of the largest count as zero in the rank
ZERO = 1e-9


def topology(run: Run) -> tuple[Variables, dict[str, object]]:
    """Variables and coordinates of the run dataset."""
    engine, trajectory, seen = run.engine, run.trajectory, run.observed
    redundant = np.array([name in engine.mobility.redundant_joints for name in run.scene.joint], dtype=np.int8)
    variables: Variables = {"reaction_redundant": (("joint",), redundant)}
    rows, nv = len(trajectory.rows), engine.model.nv
    values = _singular_values(engine, trajectory, seen, singular.natural)
    rank = np.zeros(rows, dtype=np.int32)
    if values.shape[1]:
        rank = np.sum(values > ZERO * values[:, :1], axis=1).astype(np.int32)
        told = _singular_values(engine, trajectory, seen, singular.scaled)
        least = np.maximum(told[:, -1], told[:, 0] / INFINITE)
        variables["condition"] = (("time",), np.minimum(told[:, 0] / least, INFINITE))
    variables["rank"] = (("time",), rank)
    variables["mobility"] = (("time",), (nv - rank).astype(np.int32))
    if not values.shape[1]:
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
    """Singular values of every row's closure Jacobian, with the rows solved for there; shape (time, rank)."""
    parts = []
    for part, kept in trajectory.parts():
        engine.keep(kept)
        J = selection.dense(engine.model, engine.h, seen.jacobian[part])
        parts.append(scale(engine.model, engine.h, J))
    J = np.concatenate(parts)
    return np.linalg.svd(J, compute_uv=False) if J.size else np.zeros((len(J), 0))
