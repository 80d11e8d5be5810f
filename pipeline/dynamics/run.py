"""One run from scene to observed rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.core.errors import SolverError
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.assembly.numbers import tabulate
from pipeline.dynamics.assembly.system import build
from pipeline.dynamics.integrate.engine import Engine, Progress, consistent_start, observe, prepare
from pipeline.dynamics.integrate.trajectory import Trajectory
from pipeline.dynamics.integrate.trajectory import integrate as step


@dataclass(frozen=True)
class Run:
    """A finished integration. start_residual: loops' residual as the scene gives its start [m]."""

    engine: Engine
    trajectory: Trajectory
    observed: dict[str, np.ndarray]
    start_residual: float


def engine_of(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Engine:
    """The compiled engine of a scene."""
    return prepare(tabulate(build(scene, bundles)), progress)


def integrate(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Run:
    """Build, start, integrate and observe a scene."""
    engine = engine_of(scene, bundles, progress)
    start, residual = consistent_start(engine)
    trajectory = step(engine, start, progress)
    return Run(engine, trajectory, observed(engine, trajectory), residual)


def observed(engine: Engine, trajectory: Trajectory) -> dict[str, np.ndarray]:
    """The observed rows of a trajectory; SolverError where one of them could not be evaluated."""
    seen = _observed_rows(engine, trajectory)
    bad = np.flatnonzero(seen["status"][:, 0])
    if len(bad):
        raise SolverError(
            f"at t = {trajectory.time[bad[0]]:.6g} s: the recorded state does not satisfy the loop closures"
        )
    return seen


def _observed_rows(engine: Engine, trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Every row with the closure rows that were solved for when it was made."""
    parts = []
    for part, kept in trajectory.parts():
        engine.keep(kept)
        parts.append(observe(engine, trajectory.rows[part]))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
