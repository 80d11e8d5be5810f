"""How long a run with contacts can be believed point by point: the same run from a start that differs by a hair.

Impacts make neighbouring motions part exponentially, so that the errors of any integration grow too.
The twin starts as far away as one step at the run's tolerance may err; where its velocities have
parted from the run's by a visible share, values of the run are one draw out of many.

The twin goes on beside the run where a processor is free, else after it. It takes the run's own steps of another start,
with the same times of output, and is cut off where all has been seen: what is told of it does not depend on which of
the two was ahead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Condition

import numpy as np

from flexclear.pipeline.core.errors import SolverError, StoppedError
from flexclear.pipeline.core.progress import Progress
from flexclear.pipeline.core.quantities import PARTED
from flexclear.pipeline.core.workflow.cores import TICK
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.run.engine import Engine, another
from flexclear.pipeline.dynamics.run.observation import frames
from flexclear.pipeline.dynamics.run.singular import select_rows
from flexclear.pipeline.dynamics.run.start import project, rates_at_speeds
from flexclear.pipeline.dynamics.run.trajectory import Followed, Stop, output_times

#: the two are compared at about so many times, which bounds the cost; where outputs are rarer, between these as well
SAMPLES = 180
#: comparisons for which the twin is followed beyond the horizon, which show how fast the two part
BEYOND = 5
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


@dataclass
class _Seen:
    """What is known of one of the two. rows: so far.  velocities: of the links' frames, (times so far, link, 3)."""

    rows: np.ndarray
    velocities: np.ndarray


class Pair:
    """A run and its twin, which may go on in two threads, each on an engine of its own; a third looks at their rows.

    outputs: times [s] of which both keep rows.  added: those among them that the scene does not ask for.
    """

    def __init__(self, engine: Engine) -> None:
        wanted = output_times(engine.breaks, engine.model.scene.output.interval)
        self.added = _between(engine, wanted)
        self.outputs = np.union1d(wanted, self.added)
        self.times = np.union1d(self.outputs[:: max(1, len(self.outputs) // SAMPLES)], self.outputs[-1])
        self._engine, self._looking = another(engine), another(engine)
        self._run, self._news = self._unseen(), Condition()
        self._complete, self._ended = False, False

    def run(self, steps: Callable[[Stop, np.ndarray], Followed]) -> Followed:
        """What the run gives that takes these steps, without the rows that it has for comparisons alone."""
        try:
            engine, trajectory, switched = steps(self._hear, self.outputs)
            self._hear(trajectory.rows)
            self._complete = True
        except StoppedError as stopped:
            if stopped.partial is not None:
                engine, trajectory = stopped.partial
                stopped.partial = engine, trajectory.without(self.added)
            raise
        finally:
            with self._news:
                self._ended = True
                self._news.notify_all()
        return engine, trajectory.without(self.added), switched

    def twin(
        self, start: np.ndarray, steps: Callable[[Engine, np.ndarray, Stop, np.ndarray], Followed], alive: Progress
    ) -> Twin:
        """Run the scene again from a start whose balls are offset, and compare the links' velocities.

        steps: takes the same steps as the run, with an engine from a start.  alive: called while it waits for the run;
        what it raises ends the work.
        """
        engine, twin, failed = self._engine, self._unseen(), False
        size = max(engine.rtol * engine.model.length, SMALLEST)

        def enough(rows: np.ndarray) -> bool:
            twin.rows = rows
            return self._enough(twin, alive)

        try:
            select_rows(engine, start, engine.start)
            direction = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)  # along no axis of a mechanism
            offsets = np.tile(size * direction, len(engine.model.contacts))
            moved = perturbed(engine, start, offset_jacobian(engine, start), offsets)
            twin.rows = steps(engine, moved, enough, self.outputs)[1].rows
        except SolverError:
            failed = True
        self._wait(lambda: self._ended, alive)
        time, separation, horizon = self._compared(twin)
        if failed and horizon is None:
            # a neighbour that cannot be run says nothing for the run itself: it is believed nowhere
            return Twin(size, np.array([engine.start]), np.zeros(1), engine.start)
        return Twin(size, time, separation, engine.end if horizon is None else horizon)

    def _hear(self, rows: np.ndarray) -> bool:
        """Take note of how far the run has come; it goes on."""
        with self._news:
            self._run.rows = rows
            self._news.notify_all()
        return False

    def _enough(self, twin: _Seen, alive: Progress) -> bool:
        """Whether the twin has been followed far enough beyond the horizon.

        What is visible depends on the largest velocity of the whole run. Where the two have parted by the largest one
        so far, the twin waits for the run instead of going on, since that seldom changes.
        """
        while True:
            with self._news:
                complete, ended, known = self._complete, self._ended, self._run.rows
            self._look(self._run)
            self._look(twin)
            parted = np.flatnonzero(self._apart(twin) > self._visible())
            if not len(parted) or len(twin.velocities) < min(parted[0] + BEYOND + 1, len(self.times)):
                return False
            if complete or ended:
                return complete
            self._wait_beyond(known, alive)

    def _wait_beyond(self, known: np.ndarray, alive: Progress) -> None:
        """Wait until there is more of the run than the rows that are known, or no more will come."""
        self._wait(lambda: self._ended or self._run.rows is not known, alive)

    def _wait(self, until: Callable[[], bool], alive: Progress) -> None:
        """Wait for news of the run; a run that has failed before it began sends none."""
        with self._news:
            while not self._news.wait_for(until, TICK):
                alive(None, "")

    def _compared(self, twin: _Seen) -> tuple[np.ndarray, np.ndarray, float | None]:
        """Times of comparison [s], distances [m/s] and the horizon [s], when both have ended; None where they stay."""
        self._look(self._run)
        self._look(twin)
        apart, visible = self._apart(twin), self._visible()
        time, parted = self.times[: len(apart)], np.flatnonzero(apart > visible)
        if not len(parted):
            return time, apart, None
        k = int(parted[0])
        time, apart = time[: k + BEYOND + 1], apart[: k + BEYOND + 1]
        finer = self.outputs[(self.outputs > self.times[max(k - 1, 0)]) & (self.outputs < self.times[k])]
        between = _distance(self._velocities(self._run.rows, finer), self._velocities(twin.rows, finer))
        first = np.flatnonzero(between > visible)[:1]
        horizon = float(finer[first[0]] if len(first) else time[k])
        return np.insert(time, k, finer[first]), np.insert(apart, k, between[first]), horizon

    def _unseen(self) -> _Seen:
        model = self._looking.model
        rows = m.empty_record(0, len(model.contacts), model.ny)
        return _Seen(rows, np.zeros((0, model.arrays.size(m.N_LINKS), 3)))

    def _look(self, seen: _Seen) -> None:
        """Add the velocities at the times of comparison that a run has come to since it was looked at last."""
        rows = seen.rows
        if len(rows):
            reached = int(np.searchsorted(self.times, self._time(rows)[-1], side="right"))
            new = self._velocities(rows, self.times[len(seen.velocities) : reached])
            seen.velocities = np.concatenate([seen.velocities, new])

    def _time(self, rows: np.ndarray) -> np.ndarray:
        return m.record(rows, len(self._looking.model.contacts)).time

    def _velocities(self, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Velocities of all links' frames at times of which there are rows, shape (time, link, 3)."""
        return frames(self._looking, rows[np.searchsorted(self._time(rows), times)]).links["velocity"]

    def _apart(self, twin: _Seen) -> np.ndarray:
        """Distances at the times of comparison that both have come to."""
        both = min(len(self._run.velocities), len(twin.velocities))
        return _distance(self._run.velocities[:both], twin.velocities[:both])

    def _visible(self) -> float:
        """From which distance on two motions are told apart [m/s], by what is known of the run."""
        return PARTED * float(np.linalg.norm(self._run.velocities, axis=2).max(initial=0.0))


def _distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest difference of velocities at each time."""
    return np.asarray(np.linalg.norm(one - other, axis=2).max(axis=1, initial=0.0))


def _between(engine: Engine, wanted: np.ndarray) -> np.ndarray:
    """Times [s] between outputs that are rarer than comparisons should be.

    Motions part in impacts: outputs as rare as a stroke would tell of it one stroke late.
    """
    interval = engine.model.scene.output.interval
    parts = int(np.ceil(SAMPLES * interval / (engine.end - engine.start) - 1e-9))
    if parts <= 1:
        return np.zeros(0)
    times = output_times(engine.breaks, interval / parts)
    after = np.clip(np.searchsorted(wanted, times), 1, len(wanted) - 1)
    apart = np.minimum(np.abs(times - wanted[after - 1]), np.abs(times - wanted[after]))
    return times[apart > 1e-9 * interval / parts]


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
