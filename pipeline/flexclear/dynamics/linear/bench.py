"""Test bench for poses: an engine with held drives, evaluated at any free coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.model import initial, selection
from flexclear.dynamics.model.contacts import arms
from flexclear.dynamics.model.driving import prescribed_coordinates
from flexclear.dynamics.model.gauges import angles
from flexclear.dynamics.model.interface_basis import modes_of
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.run.evaluation import closure_rows, observation
from flexclear.dynamics.run.evaluation.engine import Engine, prepare
from flexclear.dynamics.run.evaluation.start import NO_IMPACT
from flexclear.dynamics.run.run import with_driven_actuators, with_start_state
from flexclear.scene.registry import suggestion
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress

Pose = TypeVar("Pose")


@dataclass(frozen=True)
class Bench:
    """An engine with held drives. drives: position and speed of each, in the tree's sense; shape (known, 2).

    internal: internal states, such as angles beyond half a turn [rad]; the only attribute that changes with the pose.
    """

    scene: Scene
    engine: Engine
    time: float
    drives: np.ndarray
    internal: np.ndarray

    @property
    def model(self) -> Model:
        """Model of the engine."""
        return self.engine.model

    @property
    def units(self) -> np.ndarray:
        """Reference size of each drive: a radian, or the mechanism's size [m]; shape (known,)."""
        return np.array(
            [1.0 if p.dimension == "angle" else self.model.length for p in prescribed_coordinates(self.model.scene)]
        )

    @property
    def fastest(self) -> float:
        """Speed of the fastest drive [1/s]: radians, or sizes of the mechanism, per second."""
        return float(np.max(np.abs(self.drives[:, 1]) / self.units, initial=0.0))


@dataclass(frozen=True)
class Balance:
    """Forces on the coordinates in a state: M dv/dt + bias = J^T multipliers.

    bias: negative generalised forces, shape (nv,).  mass: (nv, nv).
    jacobian: rows solved for, (rows, nv).
    slip: rates at which the loops open along these rows, shape (rows,).
    acting: wrenches of inertia, gravity, loads and contacts on each link with its subtree, and those of each load and
    contact alone, as moments [N m].
    """

    bias: np.ndarray
    mass: np.ndarray
    jacobian: np.ndarray
    slip: np.ndarray
    acting: np.ndarray

    @property
    def moment(self) -> float:
        """Size of the forces that balance each other, as moments [N m].

        Their sum along the free coordinates is no measure: in balance it is rounding.
        """
        return float(np.max(np.abs(self.acting), initial=0.0))


def hold(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None,
    drives: Mapping[str, float] | None,
    moving: bool,
) -> tuple[Bench, np.ndarray]:
    """Return the bench of a scene with its drives at a time, or at given positions, and its closed positions there.

    time: [s], the scene's start when None.  drives: positions [m or rad] by name, instead of the law's.
    moving: True when the drives keep their speed at that time.
    Raises InputError for unknown drives, SolverError when the loops cannot be closed there.
    """
    moved, given = with_driven_actuators(with_start_state(scene, bundles, progress)[0], bundles, progress)
    model = tabulate(build(moved, bundles), given)
    arrays = replace(model.arrays, h=model.arrays.h.copy(), f=model.arrays.f.copy())
    engine = prepare(replace(model, arrays=arrays), progress)
    start = initial.start_state(model)
    engine.select_pieces_after(engine.start)
    closure_rows.select_rows(engine, start, engine.start)
    at = engine.start if time is None else time
    first, last = drive_state(engine, engine.start), drive_state(engine, at)
    if not moving:
        last[:, 1] = 0.0
    for name, value in (drives or {}).items():
        k = drive_number(model, name)
        last[k, 0] = model.drive_signs[k] * value
    engine.modes[:], engine.latched[:] = 1, NO_IMPACT
    first[:, 1] = 0.0
    bench = Bench(scene, engine, at, first, np.zeros(arrays.size(m.N_INTERNAL)))
    set_drives(bench, first)
    q = move_drives(bench, close(bench, start[: model.nq]), last[:, 0])
    set_drives(bench, last)
    return replace(bench, drives=last), q


def drive_number(model: Model, name: str) -> int:
    """Return the index of a drive; raise InputError for an unknown name."""
    if name not in model.drives:
        remedy = suggestion(name, list(model.drives)) if model.drives else "the scene has no drives"
        raise InputError(f"drive '{name}'", "unknown drive", remedy)
    return model.drives.index(name)


def drive_state(engine: Engine, time: float) -> np.ndarray:
    """Return position and speed of every drive at a time, in the tree's sense, shape (known, 2)."""
    engine.select_pieces_after(time)
    engine.evaluate_laws(time)
    laws = engine.table(m.LAW)[: len(engine.model.drives)]
    return np.stack([laws["value"], laws["rate"]], axis=1)


def set_drives(bench: Bench, drives: np.ndarray) -> None:
    """Replace every drive's law by a linear one with this position and speed at the bench's time."""
    arrays = bench.model.arrays
    for (first, count), (position, speed) in zip(arrays.table(m.LAWS), drives, strict=False):
        straight = np.zeros(1, dtype=m.row_type(m.PIECES))
        straight["start"], straight["coefficients"][:, :2] = bench.time, (position, speed)
        arrays.table(m.PIECES)[first : first + count] = straight
        arrays.table(m.PIECE_HARMONICS, bench.engine.h)["n_harmonics"][first : first + count] = 0
    bench.engine.select_pieces_after(bench.time)


@contextmanager
def advance_drives(bench: Bench, duration: float) -> Iterator[Bench]:
    """Yield the bench with its drives as they are after a duration [s] at constant speed."""
    drives = bench.drives.copy()
    drives[:, 0] += duration * drives[:, 1]
    set_drives(bench, drives)
    try:
        yield replace(bench, drives=drives)
    finally:
        set_drives(bench, bench.drives)


def move_drives(bench: Bench, q: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the positions after the drives have moved to `target` in steps, with loops closed after each."""
    if not bench.model.closures:
        return q
    origin = bench.drives[:, 0]
    way = float(np.max(np.abs(target - origin) / bench.units, initial=0.0))

    def positions_at(fraction: float, start: np.ndarray) -> np.ndarray:
        set_drives(bench, np.stack([origin + fraction * (target - origin), 0.0 * target], axis=1))
        return close(bench, start)

    # smallest step, as a fraction of the whole way, before the pose counts as out of reach
    # 0.05: drives reach the requested pose in steps of this fraction of the mechanism's size, or this angle
    return approach_in_steps(positions_at, q, min(1.0, 0.05 / way) if way > 0.0 else 1.0, 1e-4)


def approach_in_steps(at: Callable[[float, Pose], Pose], pose: Pose, longest: float, shortest: float) -> Pose:
    """Return the pose at the end of a way by steps of at(fraction of the way, pose before) from the pose at its start.

    A step is halved where `at` raises SolverError, which is re-raised below the shortest step.
    """
    fraction = 0.0
    while fraction < 1.0:
        stride = min(longest, 1.0 - fraction)
        while True:
            try:
                pose = at(min(1.0, fraction + stride), pose)
                break
            except SolverError:
                stride *= 0.5
                if stride < shortest:
                    raise
        fraction = min(1.0, fraction + stride)
    return pose


def state(bench: Bench, q: np.ndarray, v: np.ndarray | None = None) -> np.ndarray:
    """Return the state vector with positions q and speeds v (at rest when None)."""
    y = np.zeros(bench.model.ny)
    y[: bench.model.nq] = q
    if v is not None:
        y[bench.model.speeds] = v
    y[len(y) - len(bench.internal) :] = bench.internal
    return y


def rows(bench: Bench, states: np.ndarray) -> np.ndarray:
    """Return rows of the record for states, with all contacts in mode 1: a contact acts where it penetrates."""
    return observation.rows_of(bench.engine, states, bench.time, 1.0, NO_IMPACT)


def observe(bench: Bench, states: np.ndarray) -> Observed:
    """Return the engine's observation of states, after closing the loops."""
    return observation.observe(bench.engine, rows(bench, states), after=True)


def close(bench: Bench, q: np.ndarray) -> np.ndarray:
    """Return the positions with closed loops and update internal angles; raise SolverError when closing fails."""
    seen = observe(bench, state(bench, q)[None, :])
    if seen.status[0] != m.OK:
        raise SolverError(f"at t = {bench.time:.6g} s: the loops cannot be closed in the pose of the drives")
    for index, angle in angles(bench.model.arrays.table(m.GAUGES), seen.sites[0]).items():
        before = bench.internal[index]
        bench.internal[index] = angle + 2.0 * np.pi * np.round((before - angle) / (2.0 * np.pi))
    for index, vector in initial.of_effects(bench.model, seen.sites[0], bench.internal).items():
        bench.internal[index : index + len(vector)] = vector
    return seen.state[0, : len(q)].copy()


def displacement_map(bench: Bench, q: np.ndarray) -> np.ndarray:
    """Return the change of the positions per small displacement of each coordinate, shape (nq, nv)."""
    nq, nv = bench.model.nq, bench.model.nv
    changes = [closure_rows.evaluate(bench.engine, state(bench, q, e), bench.time)[:nq] for e in np.eye(nv)]
    return np.array(changes).T.reshape(nq, nv)


def balance(bench: Bench, q: np.ndarray, v: np.ndarray | None = None) -> Balance:
    """Return forces, mass and closure rows in a state; raise SolverError where forces are not finite."""
    from flexclear.dynamics.run.evaluation.matrices import holding_forces  # here: it imports the compiler

    engine, model = bench.engine, bench.model
    closure_rows.evaluate(engine, state(bench, q, v), bench.time)
    forces, on_links = holding_forces(engine)
    if not np.all(np.isfinite(forces)):
        raise SolverError(f"at t = {bench.time:.6g} s: the forces are not numbers in this pose")
    slip = engine.view(m.RESIDUAL_RATE)[selection.selected_indices(model, engine.h)]
    loads, touch = (engine.table(table) for table in (m.LOAD, m.TOUCH))
    length, moments = model.length, [on_links[:, :3], loads["moment"]]
    reach = length / arms(model.mechanism)  # ends of angles have torques
    pushes = [length * on_links[:, 3:], length * loads["force"], reach[:, None] * touch["force"]]
    acting = np.concatenate([v.ravel() for v in [*pushes, *moments]])
    return Balance(modes_of(model.arrays) @ forces, *inertia(engine), slip, acting)


def inertia(engine: Engine) -> tuple[np.ndarray, np.ndarray]:
    """Return mass and closure Jacobian in the state evaluated last, shapes (nv, nv) and (rows, nv)."""
    from flexclear.dynamics.run.evaluation.matrices import Matrices

    modes = modes_of(engine.model.arrays)
    L = modes @ Matrices(engine).factor
    return L @ L.T, engine.jacobian @ modes.T
