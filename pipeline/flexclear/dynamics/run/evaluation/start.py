"""A consistent start: loops closed, speeds projected, closed contacts detected."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.model import initial
from flexclear.dynamics.model.given_start import corrected_starts
from flexclear.dynamics.model.internal_states import recorded_states
from flexclear.dynamics.model.merge import Placement
from flexclear.dynamics.model.plausibility import refuse_depth
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.scene.drives import PathDrive
from flexclear.system.errors import InputError, SolverError, all_or_errors

#: impact rate of a contact at rest: its damping no longer depends on the past impact [m/s]
NO_IMPACT = 1e300


def consistent_start(engine: Engine) -> np.ndarray:
    """Return the state at the start with closed loops and the bodies' given velocities, shape (NY,).

    Raises InputError for a start that joints, drives or surfaces do not allow.
    """
    y = closed_start(engine)
    model, depths = engine.model, overlap_depths(engine, y).items()
    all_or_errors(partial(refuse_depth, model.scene, model.contacts[c], depth) for c, depth in depths)
    return y


def closed_start(engine: Engine) -> np.ndarray:
    """Return the state of `consistent_start`, which depends smoothly on numbers, also where surfaces overlap."""
    model = engine.model
    engine.select_pieces_after(engine.start)
    y = initial.start_state(model)
    closure_rows.select_rows(engine, y, engine.start)
    if not engine.mobility.singular_start:
        y = _close_loops(engine, y)
    # a singular pose has no rates to project on
    fraction = 0.0 if engine.mobility.singular_start else initial.WRONG
    y = initial.given_velocities(model, start_motions(engine), y, fraction)
    if not engine.mobility.singular_start:
        y = project(engine, y)
    if model.loads or model.arrays.size(m.N_INTERNAL):
        _evaluate_kinematics(engine, y)
        y = initial.start_internal(model, y, engine.table(m.SITE_FRAMES))
    return recorded_states(model, y)


def start_motions(engine: Engine) -> initial.Motions:
    """Return the effect of speeds at the start: motions of the links, and rates at which the loops open."""

    def motion(state: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        _evaluate_kinematics(engine, state)
        return engine.table(m.LINK_FRAMES), engine.table(m.SITE_FRAMES), engine.view(m.RESIDUAL_RATE).copy()

    return motion


def mends(engine: Engine, y: np.ndarray) -> list[str]:
    """Return sentences about the differences of a consistent start y from the scene's poses and velocities."""
    _evaluate_kinematics(engine, y)
    frames = engine.table(m.LINK_FRAMES)
    now = [Placement(frame["origin"], frame["axes"]) for frame in frames]
    model = engine.model
    bent = initial.changed_positions(model, initial.start_state(model), y)
    speeds = initial.changed_velocities(model, frames, engine.table(m.SITE_FRAMES), y)
    return [*corrected_starts(model.mechanism, now), *bent, *speeds]


def _close_loops(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Apply `project` to a start that only the engine can close: with paths, or with flexible bodies."""
    try:
        return project(engine, y)
    except SolverError as error:
        paths = [name for name, drive in engine.model.scene.drive.items() if isinstance(drive, PathDrive)]
        path = f"[drive.{paths[0]}]" if paths else "[joint]"
        what = "correct the start of the path, or the poses" if paths else "correct lengths, frames or poses"
        raise InputError(path, f"the mechanism cannot be assembled: {error}", what) from None


def _evaluate_kinematics(engine: Engine, y: np.ndarray) -> None:
    """Evaluate the kinematics at the start; a singular pose has no unique accelerations."""
    if engine.mobility.singular_start:
        engine.attempt(y, engine.start)
    else:
        closure_rows.evaluate(engine, y, engine.start)


def project(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Return Y at the start with the loops closed and their rates zero. Raise SolverError when that fails."""
    seen = observe(engine, rows_of(engine, y[None], engine.start))
    if seen.status[0] != m.OK:
        why = engine.explained() or "the loops cannot be closed from the scene's start"
        raise SolverError(f"at t = {engine.start:.6g} s: {why}")
    return seen.state[0].copy()


def rates_at_speeds(engine: Engine, y: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Return the rates of a state at the start with other speeds, as nearly as drives and loops allow."""
    corrected_starts = y.copy()
    corrected_starts[engine.model.speeds] = speeds
    return closure_rows.evaluate(engine, project(engine, corrected_starts), engine.start)


def per_speed(engine: Engine, y: np.ndarray, read: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the change of `read`'s result, from rates or work array, per unit of each free speed; shape (..., nv).

    It is the difference from the result at the speeds of the drives alone: no step width enters.
    """
    nv = engine.model.nv
    driven = read(rates_at_speeds(engine, y, np.zeros(nv)))
    changes = [read(rates_at_speeds(engine, y, unit)) - driven for unit in np.eye(nv)]
    return np.moveaxis(np.reshape(changes, (nv, *np.shape(driven))), 0, -1)


def overlap_depths(engine: Engine, y: np.ndarray) -> dict[int, float]:
    """Return the contacts whose surfaces overlap at the start, by index, and their depths [m]."""
    if not engine.model.contacts:
        return {}
    closure_rows.evaluate(engine, y, engine.start)
    gaps = engine.table(m.TOUCH)["gap"]
    # 1e-9: surfaces that overlap by less than this fraction of the clearance touch
    touching = -1e-9 * engine.model.arrays.table(m.CONTACT_NUMBERS)["clearance"]
    return {int(c): -float(gaps[c]) for c in np.flatnonzero(gaps < touching)}
