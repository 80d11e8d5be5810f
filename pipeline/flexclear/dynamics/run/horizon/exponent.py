"""Largest Lyapunov exponent and predictability horizon of a run, by tangent equations with jumps at impacts.

In the long run, a change of the start grows by the largest exponent: the slope of the logarithm of its size in the norm
of the kinetic energy. That needs no second run and no finite distance: the change is infinitesimal. Scaled to the
change of a perturbed run, it shows when that run would be visibly separated, as long as the change is small.

Source: Mueller (1995), Chaos, Solitons & Fractals 5, 1671-1681 (exponents of systems with discontinuities).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexclear.artifacts.quantities import PERTURBATION, index_of_separation
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import project
from flexclear.dynamics.run.horizon.horizon import Metric, asymmetric, moved_start
from flexclear.dynamics.run.horizon.tangents import Differentiated, Direction

#: batches of the exponent's error, and Student's t of their number at 95 %
EXPONENT_BATCHES, STUDENT = 10, 2.262
#: step of finite differences of a state, as a fraction of its magnitudes: the square is rounding
STATE_CHANGE = 1e-6


@dataclass(frozen=True)
class Growth:
    """Growth of a change of the start.

    exponent, error: mean growth rate of its logarithm over the run and half of the 95 % interval, from batch means
    [1/s].  horizon [s]: when a perturbed run would be visibly separated; end of the run where it never is.
    """

    exponent: float
    error: float
    horizon: float


def start_direction(engine: Engine, y: np.ndarray) -> Direction:
    """Return the direction that changes a consistent start as a perturbed run does, and no numbers.

    For a mechanism without contacts, a change of the same size along no axis.
    """
    model, nothing = engine.model, np.zeros(len(engine.model.arrays.f))
    if model.contacts:
        return Direction(nothing, moved_start(engine, y) - y)
    end = model.speeds.stop
    change = np.zeros(len(y))
    change[:end] = STATE_CHANGE * engine.magnitudes[:end] * asymmetric(end)
    return Direction(
        nothing, PERTURBATION / STATE_CHANGE * 0.5 * (project(engine, y + change) - project(engine, y - change))
    )


def growth(engine: Engine, run: Differentiated, k: int) -> Growth:
    """Return the growth of the change along direction k of a run."""
    metric, trajectory = Metric(engine), run.trajectory
    changes, end = run.changes[:, k], engine.model.speeds.stop
    steps = STATE_CHANGE / np.maximum((np.abs(changes) / engine.magnitudes)[:, :end].max(axis=1, initial=0.0), 1e-300)
    sides = []
    for sign in (-1.0, 1.0):
        rows = trajectory.rows.copy()
        recording.record(rows, trajectory.contacts).state[:] += sign * steps[:, None] * changes
        sides.append(metric.motion(engine, rows))
    change = (sides[1] - sides[0]) / (2.0 * steps[:, None])
    rows = np.concatenate([trajectory.rows, trajectory.between])
    largest = metric.norms(metric.motion(engine, rows)).max(axis=0, initial=0.0)
    separation = metric.distance(change, np.zeros_like(change), largest)
    time = trajectory.time
    first = index_of_separation(time, separation, engine.end - engine.start)
    mean, error = _slope(time, np.log(np.maximum(np.linalg.norm(change, axis=1), 1e-300)))
    return Growth(mean, error, engine.end if first is None else float(time[first]))


def _slope(time: np.ndarray, logarithm: np.ndarray) -> tuple[float, float]:
    """Return the mean slope and half of its 95 % interval.

    The first batch is left out: in it the change turns to the direction that grows.
    """
    ends = np.linspace(time[0], time[-1], EXPONENT_BATCHES + 2)[1:]
    slopes = np.diff(np.interp(ends, time, logarithm)) / np.diff(ends)
    return float(slopes.mean()), float(STUDENT * slopes.std(ddof=1) / np.sqrt(EXPONENT_BATCHES))
