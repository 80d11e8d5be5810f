"""How long a run with contacts can be believed point by point: the same run from a start that differs by a hair.

Impacts make neighbouring motions part exponentially, so that the errors of any integration grow too.
The twin starts as far away as one step at the run's tolerance may err; where its velocities have
parted from the run's by a visible share, values of the run are one draw out of many.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexclear.pipeline.core.artifacts.event_kinds import OPENING
from flexclear.pipeline.core.errors import SolverError
from flexclear.pipeline.core.progress import silent
from flexclear.pipeline.core.quantities import PARTED
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.engine import Engine
from flexclear.pipeline.dynamics.run.observation import frames
from flexclear.pipeline.dynamics.run.start import project, rates_at_speeds
from flexclear.pipeline.dynamics.run.trajectory import Trajectory, integrate, output_times

#: the two are compared at so many regular outputs, which bounds the cost, and wherever a contact of the run ends
SAMPLES = 180
#: offsets below this cannot be told from rounding of the positions [m]
SMALLEST = 1e-14


@dataclass(frozen=True)
class Twin:
    """Distance of the velocities of two runs.

    perturbation [m]; time [s], separation [m/s], shape (n,); horizon [s], the start where the twin fails.
    """

    perturbation: float
    time: np.ndarray
    separation: np.ndarray
    horizon: float


def twin(engine: Engine, start: np.ndarray, trajectory: Trajectory) -> Twin:
    """Run the scene again from a start whose balls are offset, and compare the links' velocities."""
    contacts = len(engine.model.contacts)
    size = max(engine.rtol * engine.model.length, SMALLEST)
    direction = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)  # along no axis of a mechanism
    moved = perturbed(engine, start, offset_jacobian(engine, start), np.tile(size * direction, contacts))
    time = _compared(engine, trajectory)
    one = _velocities(engine, trajectory, time)
    visible = PARTED * float(np.linalg.norm(one, axis=2).max())

    def parted(rows: np.ndarray) -> bool:
        """Whether the twin is already beyond the horizon, where following it further tells nothing."""
        k = int(np.searchsorted(time, m.record(rows, contacts).time[-1], side="right")) - 1
        w, n = engine.w.copy(), engine.n.copy()  # the twin's integration goes on with these
        two = _velocities(engine, replace(trajectory, rows=rows), time[[k]])
        engine.w[:], engine.n[:] = w, n
        return bool(np.linalg.norm(one[[k]] - two, axis=2).max() > visible)

    try:
        other = integrate(engine, moved, silent, parted, outputs=time)
    except SolverError:
        # a neighbour that cannot be run says nothing for the run itself: it is believed nowhere
        return Twin(size, np.array([engine.start]), np.zeros(1), engine.start)
    time = time[time <= other.time[-1]]
    separation = np.linalg.norm(one[: len(time)] - _velocities(engine, other, time), axis=2).max(axis=1)
    beyond = np.flatnonzero(separation > visible)
    return Twin(size, time, separation, float(time[beyond[0]] if len(beyond) else engine.end))


def _compared(engine: Engine, trajectory: Trajectory) -> np.ndarray:
    """Times at which the two are compared, of which the run has rows.

    Motions part in impacts: where outputs are as rare as a stroke, they alone would tell of it one stroke late.
    """
    regular = output_times(engine.breaks, engine.model.scene.output.interval)
    openings = trajectory.events["time"][trajectory.events["kind"] == OPENING]
    return np.union1d(np.append(regular[:: max(1, len(regular) // SAMPLES)], regular[-1]), openings)


def _velocities(engine: Engine, trajectory: Trajectory, time: np.ndarray) -> np.ndarray:
    """Velocities of all links' frames at times that the trajectory has, shape (time, link, 3)."""
    rows = trajectory.rows[np.searchsorted(trajectory.time, time)]
    return frames(engine, rows).links["velocity"]


def offset_jacobian(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Change of the ball-to-socket vectors (world) per change of the positions, closures kept; (3 contacts, nv).

    Of a stop, whose way has no direction in space, its three rows are alike.  From the velocities that unit speeds add
    to those of the drives, so that no step width enters.
    """
    engine.select_pieces_after(engine.start)
    contacts, stops = engine.model.arrays.table(m.CONTACTS), engine.model.arrays.size(m.N_SURFACES)

    def offset_rates(speeds: np.ndarray) -> np.ndarray:
        rates_at_speeds(engine, y, speeds)
        velocity = engine.table(m.SITE_FRAMES)["velocity"]
        offset = velocity[contacts["inner"]] - velocity[contacts["outer"]]
        offset[stops:] = engine.table(m.TOUCH)["rate"][stops:, None]
        return np.asarray(offset).ravel()

    driven = offset_rates(np.zeros(engine.model.nv))
    return np.array([offset_rates(unit) - driven for unit in np.eye(engine.model.nv)]).T


def perturbed(engine: Engine, y: np.ndarray, jacobian: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The start with the balls moved by `offsets` (3 per contact) [m] as nearly as the joints allow."""
    engine.select_pieces_after(engine.start)
    speeds, *_ = np.linalg.lstsq(jacobian, offsets, rcond=1e-9)
    moved, nq = y.copy(), engine.model.nq
    # rates per unit time, for one unit: a displacement of 1e-8 m is linear
    moved[:nq] += rates_at_speeds(engine, y, speeds)[:nq] - rates_at_speeds(engine, y, np.zeros(len(speeds)))[:nq]
    return project(engine, moved)
