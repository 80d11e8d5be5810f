"""Derivatives of recorded series, from the derivatives of the states.

A row of the record is observed at four points along the direction of its own change, with a step for each row: a
closed contact moves by a small part of its penetration, which is millionths of the clearance. So the code that
records a quantity also differentiates it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from flexclear.dynamics.integrate import recording
from flexclear.dynamics.record.dataset import series
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.horizon.tangents import Differentiated
from flexclear.dynamics.run.run import observe_run
from flexclear.dynamics.sensitivity.parameters import Family, Parameter, central_difference
from flexclear.scene.quantity import Quantity

#: name of the contacts' normal forces among the series
NORMAL_FORCE = "normal force"

Series = dict[str, np.ndarray]


def read_quantities(family: Family, engine: Engine, run: Differentiated, requested: Collection[Quantity]) -> Series:
    """Return quantities over time, (rows, components), by name; and NORMAL_FORCE, (rows, contacts)."""
    seen = observe_run(engine, run.trajectory)
    result = series(family.scene, Motions(engine.model, seen), requested, run.trajectory.time)
    return result | {NORMAL_FORCE: seen.touch["normal_force"]}


def derivatives(
    family: Family, run: Differentiated, k: int, parameter: Parameter, widest: float, requested: Collection[Quantity]
) -> Series:
    """Return the derivatives of the series of `read_quantities` along direction k of a run, per unit of the parameter.

    widest: step of the parameter at which its start is smooth.
    """
    result: Series = {}
    # rows with equal steps together
    powers = np.floor(np.log10(_steps(family, run, k, parameter, widest)) + 1e-9).astype(int)
    for power in np.unique(powers):
        rows, step = np.flatnonzero(powers == power), 10.0**power
        around = {
            j: read_quantities(
                family, family.changed(parameter, j * step), move_rows(run, k, rows, j * step), requested
            )
            for j in (-2, -1, 1, 2)
        }
        for name in around[1]:
            change = central_difference({j: values[name] for j, values in around.items()}, step)
            result.setdefault(name, np.zeros((len(run.trajectory.rows), change.shape[1])))[rows] = change
    return result


def move_rows(run: Differentiated, k: int, rows: np.ndarray, step: float) -> Differentiated:
    """Return some rows of a run, moved by a step along direction k."""
    some = run.trajectory.rows[rows]
    record = recording.record(some, run.trajectory.contacts)
    record.state[:] += step * run.changes[rows, k]
    record.latched[:] += step * run.impact_rates[rows, k]
    return replace(run, trajectory=replace(run.trajectory, rows=some))


def _steps(family: Family, run: Differentiated, k: int, parameter: Parameter, widest: float) -> np.ndarray:
    """Return the step of each row."""
    model, changes = family.engine.model, np.abs(run.changes[:, k])
    positions = slice(0, model.speeds.stop)
    size = np.maximum(np.abs(run.trajectory.state), family.engine.magnitudes)[:, positions]
    steps = widest / np.maximum(1.0, (changes[:, positions] / size).max(axis=1, initial=0.0))
    if model.contacts:
        everything, probe = np.arange(len(steps)), float(steps.min()) * 1e-3
        sides = [(family.changed(parameter, j * probe), move_rows(run, k, everything, j * probe)) for j in (-1, 1)]
        gaps = [observe_run(engine, side.trajectory).touch["gap"] for engine, side in sides]
        depth, change = -0.5 * (gaps[0] + gaps[1]), np.abs(gaps[1] - gaps[0]) / (2.0 * probe)
        closed = (recording.record(run.trajectory.rows, run.trajectory.contacts).modes == 1) & (depth > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            # step of a closed contact, as a fraction of its penetration
            allowed = np.where(closed & (change > 0.0), 1e-2 * depth / change, np.inf)
        steps = np.minimum(steps, allowed.min(axis=1))
    # 1e-10: steps along a direction are powers of ten, from this one [its unit] to that of its start; each changes no
    # quantity by a larger fraction of its size
    return np.clip(steps, 1e-10, widest)
