"""The largest exponent of a run, and its horizon, by the tangent equations with the jumps of impacts.

A change of the start grows, in the long run, by the largest exponent: the slope of the logarithm of its size in the
norm of the kinetic energy. No second run is needed, and no distance: the change is infinitely small. As large as that
of a perturbed run, it says when such a run would be visibly separated, as long as it is small.

Source: Mueller (1995), Chaos, Solitons & Fractals 5, 1671-1681 (exponents of systems with discontinuities).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexclear.pipeline.core.artifacts.quantities import PERTURBATION, separated_from
from flexclear.pipeline.dynamics.integrate import recording
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import project
from flexclear.pipeline.dynamics.run.horizon.horizon import Metric, askew, moved_start
from flexclear.pipeline.dynamics.run.horizon.tangents import Differentiated, Direction

#: batches of the exponent's error, and Student's t of their number at 95 %
EXPONENT_BATCHES, STUDENT = 10, 2.262
#: change of a state whose motion is compared, as a fraction of what counts as far: its square is rounding
STATE_CHANGE = 1e-6


@dataclass(frozen=True)
class Growth:
    """How a change of the start grows.

    exponent, error: the mean growth of its logarithm over the run and half of the 95 % interval, from batch means
    [1/s].  horizon [s]: when a perturbed run would be visibly separated; end of the run where it never is.
    """

    exponent: float
    error: float
    horizon: float


def start_direction(engine: Engine, y: np.ndarray) -> Direction:
    """Return the change of a consistent start by which a perturbed run begins, and none of the numbers.

    Of a mechanism without contacts one along no axis, as large.
    """
    model, nothing = engine.model, np.zeros(len(engine.model.arrays.f))
    if model.contacts:
        return Direction(nothing, moved_start(engine, y) - y)
    end = model.speeds.stop
    change = np.zeros(len(y))
    change[:end] = STATE_CHANGE * engine.magnitudes[:end] * askew(end)
    return Direction(
        nothing, PERTURBATION / STATE_CHANGE * 0.5 * (project(engine, y + change) - project(engine, y - change))
    )


def growth(engine: Engine, run: Differentiated, k: int) -> Growth:
    """Return how the change along direction k of a run grows."""
    metric, trajectory = Metric(engine), run.trajectory
    changes, end = run.changes[:, k], engine.model.speeds.stop
    steps = STATE_CHANGE / np.maximum((np.abs(changes) / engine.magnitudes)[:, :end].max(axis=1, initial=0.0), 1e-300)
    sides = []
    for sign in (-1.0, 1.0):
        rows = trajectory.rows.copy()
        recording.record(rows, trajectory.contacts).state[:] += sign * steps[:, None] * changes
        sides.append(metric.motion(engine, rows))
    change = (sides[1] - sides[0]) / (2.0 * steps[:, None])
    largest = metric.norms(metric.motion(engine, trajectory.rows)).max(axis=0, initial=0.0)
    separation = metric.distance(change, np.zeros_like(change), largest)
    time = trajectory.time
    first = separated_from(time, separation, engine.end - engine.start)
    mean, error = _slope(time, np.log(np.maximum(np.linalg.norm(change, axis=1), 1e-300)))
    return Growth(mean, error, engine.end if first is None else float(time[first]))


def _slope(time: np.ndarray, logarithm: np.ndarray) -> tuple[float, float]:
    """Return the mean slope and half of its 95 % interval.

    Without a first batch, in which the change turns to what grows.
    """
    ends = np.linspace(time[0], time[-1], EXPONENT_BATCHES + 2)[1:]
    slopes = np.diff(np.interp(ends, time, logarithm)) / np.diff(ends)
    return float(slopes.mean()), float(STUDENT * slopes.std(ddof=1) / np.sqrt(EXPONENT_BATCHES))
