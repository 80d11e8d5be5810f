"""Mobility, rank and condition along a run, its passes through singular poses, and redundant reactions."""

from __future__ import annotations

import numpy as np

from pipeline.dynamics.model import selection
from pipeline.dynamics.run import singular
from pipeline.dynamics.run.engine import Engine
from pipeline.dynamics.run.trajectory import Trajectory

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]

#: singular values of the kept closure rows below this share of the largest count as zero in the rank
ZERO = 1e-9


def topology(
    engine: Engine, trajectory: Trajectory, seen: dict[str, np.ndarray], joints: list[str]
) -> tuple[Variables, dict[str, object]]:
    """Variables and coordinates of the run dataset; joints: names along its joint dimension."""
    redundant = np.array([name in engine.mobility.redundant_joints for name in joints], dtype=np.int8)
    variables: Variables = {"reaction_redundant": (("joint",), redundant)}
    rows, nv = len(trajectory.rows), engine.model.numbering.nv
    values = _singular_values(engine, trajectory, seen)
    rank = np.zeros(rows, dtype=np.int32)
    if values.shape[1]:
        rank = np.sum(values > ZERO * values[:, :1], axis=1).astype(np.int32)
        least = np.maximum(values[:, -1], values[:, 0] / singular.INFINITE)
        variables["condition"] = (("time",), np.minimum(values[:, 0] / least, singular.INFINITE))
    variables["rank"] = (("time",), rank)
    variables["mobility"] = (("time",), (nv - rank).astype(np.int32))
    if not values.shape[1]:
        return variables, {}
    found = trajectory.passes
    variables |= {
        "pass_time": (("singular_pass",), np.array([p.time for p in found])),
        "pass_condition": (("singular_pass",), np.array([p.condition for p in found])),
        "pass_rank_loss": (("singular_pass",), np.array([p.lost for p in found], dtype=np.int32)),
    }
    return variables, {"pass_joint": ("singular_pass", np.array([p.joint for p in found], dtype=str))}


def _jacobians(engine: Engine, trajectory: Trajectory, seen: dict[str, np.ndarray]) -> np.ndarray:
    """Scaled closure Jacobian of every row, with the rows solved for there; (time, rank, nv)."""
    parts = []
    for part, kept in trajectory.parts():
        engine.keep(kept)
        J = selection.dense(engine.model, engine.h, seen["jacobian"][part])
        parts.append(singular.scaled(engine.model, engine.h, J))
    return np.concatenate(parts)


def _singular_values(engine: Engine, trajectory: Trajectory, seen: dict[str, np.ndarray]) -> np.ndarray:
    J = _jacobians(engine, trajectory, seen)
    return np.linalg.svd(J, compute_uv=False) if J.size else np.zeros((len(J), 0))
