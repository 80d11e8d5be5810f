"""Mobility, rank and condition along a run, its passes through singular poses, and redundant reactions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import SolverError
from pipeline.dynamics import memory as m
from pipeline.dynamics.equations.observation import Observed
from pipeline.dynamics.model import selection
from pipeline.dynamics.model.mobility import INFINITE
from pipeline.dynamics.run import singular
from pipeline.dynamics.run.engine import Engine
from pipeline.dynamics.run.run import Run
from pipeline.dynamics.run.trajectory import Trajectory

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]

#: singular values of the kept closure rows below this share of the largest count as zero in the rank
ZERO = 1e-9
#: a least singular value that has a minimum below this share of its median may reach zero beside that row
LOW = 0.5
#: share of the time between two rows to which a pass is located
WITHIN = 1e-9
#: a pose with a lower condition number than this is regular, however rows far apart make it look: passes are located to
#: some 1e-8 of the time between two rows, where what passes through zero has about that share of its size beside
PASSED = 1e4
#: a pass with less than this share of the run's largest kinetic energy does not choose its branch
AT_REST = 1e-10


@dataclass(frozen=True)
class Pass:
    """A singular pose on the way. lost: ranks lost; joint: whose closure is dependent there."""

    time: float
    condition: float
    lost: int
    joint: str


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
    passes = _passes(engine, trajectory, values)
    _refuse_rest(passes, trajectory, seen.energy["kinetic"])
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


def _passes(engine: Engine, trajectory: Trajectory, values: np.ndarray) -> list[Pass]:
    """Poses between two rows in which singular values of the closures pass through zero.

    A singular value has no sign, but with U S V^T = J the orthogonal factor U V^T has: it turns slowly, whatever
    the sizes of the singular values, and is reflected along those that pass through zero.
    """
    least = values[:, -1]
    lowest = np.r_[True, least[1:] <= least[:-1]] & np.r_[least[:-1] <= least[1:], True]
    valleys = np.flatnonzero(lowest & (least < LOW * np.median(least)))
    regular = np.flatnonzero(least > ZERO * values[:, 0])
    ends = {int(k) for side in ("left", "right") for k in np.searchsorted(regular, valleys, side=side)}
    near = (_pass_before(engine, trajectory, regular, k) for k in sorted(ends) if 0 < k < len(regular))
    return [p for p in near if p is not None]


def _pass_before(engine: Engine, trajectory: Trajectory, regular: np.ndarray, k: int) -> Pass | None:
    """The pass between the regular rows k - 1 and k, if there is one."""
    from scipy.optimize import minimize_scalar  # slow to import, and most runs pass nothing

    jacobian = _between(engine, trajectory, regular, k)
    (U, _, Vt), (U1, _, Vt1) = (np.linalg.svd(jacobian(share), full_matrices=False) for share in (0.0, 1.0))
    turn = U.T @ U1 @ Vt1 @ Vt.T
    lost = int(np.sum(np.linalg.eigvalsh(0.5 * (turn + turn.T)) < 0.0))
    if not lost:
        return None

    def least(share: float) -> float:
        return float(np.linalg.svd(jacobian(share), compute_uv=False)[-1])

    share = float(minimize_scalar(least, bounds=(0.0, 1.0), method="bounded", options={"xatol": WITHIN}).x)
    start, end = trajectory.time[regular[k - 1]], trajectory.time[regular[k]]
    there = np.linalg.svd(jacobian(share))
    if singular.condition(there[1]) < PASSED:
        return None
    joint = singular.worst_joint(engine, there[0][:, -1])
    return Pass(float(start + share * (end - start)), singular.condition(there[1]), lost, joint)


def _between(engine: Engine, trajectory: Trajectory, regular: np.ndarray, k: int) -> Callable[[float], np.ndarray]:
    """Scaled closure Jacobian at a share of the way from regular row k - 1 to k.

    On the polynomial that has the states and their rates at these rows and, where the motion is smooth, at their
    neighbours.
    """
    from scipy.interpolate import KroghInterpolator

    times = trajectory.time
    start, end = float(times[regular[k - 1]]), float(times[regular[k]])
    engine.keep(trajectory.selection(int(regular[k])))
    engine.select_pieces(0.5 * (start + end))
    nodes = regular[k - 1 : k + 1] if engine.model.contacts else _smooth(engine, times, regular, k)
    states, rates = trajectory.state[nodes], []
    for t, y in zip(times[nodes], states, strict=True):
        engine.attempt(y, float(t))
        rates.append(engine.slope.copy())
    values = np.stack([states, np.array(rates) * (end - start)], axis=1).reshape(-1, states.shape[1])
    path = KroghInterpolator(np.repeat((times[nodes] - start) / (end - start), 2), values)

    def jacobian(share: float) -> np.ndarray:
        engine.attempt(path(share), start + share * (end - start))
        return singular.scaled(engine.model, engine.h, engine.rows(m.JACOBIAN))

    return jacobian


def _smooth(engine: Engine, times: np.ndarray, regular: np.ndarray, k: int) -> np.ndarray:
    """Regular rows from k - 2 to k + 1 with no break of a law between them."""
    breaks = engine.breaks
    before = breaks[np.searchsorted(breaks, times[regular[k - 1]], side="right") - 1]
    after = breaks[np.searchsorted(breaks, times[regular[k]])]
    near = regular[max(k - 2, 0) : k + 2]
    return np.asarray(near[(times[near] >= before) & (times[near] <= after)])


def _refuse_rest(passes: list[Pass], trajectory: Trajectory, kinetic: np.ndarray) -> None:
    """SolverError for a singular pose passed so slowly that rounding, not motion, chooses how it goes on."""
    for p in passes:
        if np.interp(p.time, trajectory.time, kinetic) <= AT_REST * np.max(kinetic):
            raise SolverError(
                f"at t = {p.time:.6g} s: the mechanism comes to rest in a singular pose (joint {p.joint}, condition "
                f"number {p.condition:.3g}), where it can go on in several ways; give it another motion"
            )
