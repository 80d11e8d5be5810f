"""One run from scene to observed rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from pipeline.core.errors import SolverError
from pipeline.core.scene.schema import Scene
from pipeline.dynamics.drives.pieces import Pieces
from pipeline.dynamics.model.mechanism import build
from pipeline.dynamics.model.model import tabulate
from pipeline.dynamics.run.beside import beside, blurred
from pipeline.dynamics.run.collocation import Collocation
from pipeline.dynamics.run.engine import Engine, Progress, consistent_start, observe, prepare
from pipeline.dynamics.run.ledger import require_closed
from pipeline.dynamics.run.switching import follow, implicit
from pipeline.dynamics.run.trajectory import Trajectory

if TYPE_CHECKING:
    from pipeline.dynamics.run.sensitivity import Twin


@dataclass(frozen=True)
class Run:
    """A finished integration.

    scene: as the user gave it; the engine may hold another, made for it.
    start_residual: loops' residual as the scene gives its start [m].
    twin: the run's twin, of scenes with contacts.
    switched: from when on and why an implicit integrator took the place of the scene's; empty when none did.
    """

    scene: Scene
    engine: Engine
    trajectory: Trajectory
    observed: dict[str, np.ndarray]
    start_residual: float
    twin: Twin | None
    switched: str = ""


def engine_of(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Engine:
    """The compiled engine of a scene."""
    return prepare(tabulate(build(scene, bundles)), progress)


def engines(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> tuple[Engine, Callable[[], Engine]]:
    """The engine of a run, its actuators driven as their paths demand, and the maker of one with an implicit method."""
    driven, given = scene, dict[str, Pieces]()
    if any(getattr(drive, "actuators", None) for drive in scene.drive.values()):
        from pipeline.dynamics.run.inverse import actuated

        driven, given = actuated(scene, bundles, progress)

    def made(wanted: Scene) -> Engine:
        return prepare(tabulate(build(wanted, bundles), given), progress)

    return made(driven), cache(lambda: made(implicit(driven)))


def integrate(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Run:
    """Build, start, integrate and observe a scene; actuators that shall produce a path are driven as it demands."""
    engine, other = engines(scene, bundles, progress)
    start, residual = consistent_start(engine)
    engine, trajectory, switched = follow(engine, start, progress, other)
    seen = observed(engine, trajectory)
    require_closed(engine.model, trajectory, seen)
    return Run(scene, engine, trajectory, seen, residual, _twin(engine, start, trajectory), switched)


def _twin(engine: Engine, start: np.ndarray, trajectory: Trajectory) -> Twin | None:
    if not engine.model.mechanism.contacts:
        return None
    from pipeline.dynamics.run.sensitivity import twin

    return twin(engine, start, trajectory)


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
    """Every row with the closure rows that were solved for when it was made; near singular poses as beside them."""
    parts = []
    for part, kept in trajectory.parts():
        engine.keep(kept)
        seen = observe(engine, trajectory.rows[part])
        for k, motion in _near_singular(engine, trajectory.rows[part], trajectory.collocations):
            for name, value in (beside(engine, trajectory.rows[part][k], motion) or {}).items():
                seen[name][k] = value[0]
        parts.append(seen)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _near_singular(
    engine: Engine, rows: np.ndarray, motions: tuple[Collocation, ...]
) -> Iterator[tuple[int, Collocation]]:
    """Rows, by number, that are too near to a singular pose, and the motion over it to which they belong."""
    for motion in motions:
        engine.select_pieces(0.5 * (motion.start + motion.end))
        begin = np.searchsorted(rows[:, 0], motion.start, side="left" if motion.start == engine.start else "right")
        for k in range(int(begin), int(np.searchsorted(rows[:, 0], motion.end, side="right"))):
            if blurred(engine, rows[k]):
                yield k, motion
