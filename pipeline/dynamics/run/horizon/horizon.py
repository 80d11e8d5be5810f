"""Predictability horizon of a run with contacts: the growth of a small perturbation of its start.

Impacts make neighbouring motions diverge exponentially, and with them the errors of any integration. The perturbed run
starts with every contact moved by a small fraction of its clearance. The separation of the two runs is measured body by
body in the norm of the kinetic energy, so that rotations, centres of mass and vibrations all count. Where a body is
visibly separated from then on, the horizon ends; beyond it, values of the run are one draw out of many. A difference
that disappears again is none: an impact that comes a little earlier, or a perturbation that dies out.

The perturbed run is stepped concurrently where a processor is free, else after the run. It takes the run's own steps
from another start, with the same output times, and ends where they have diverged: the result does not depend on which
of the two was ahead.

Source: finite-time growth rates: Ott, *Chaos in Dynamical Systems*, 2nd ed. (2002), sec. 4.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event

import numpy as np

from flexclear.pipeline.core.artifacts.quantities import (
    LASTING,
    PERTURBATION,
    SEPARATED,
    divergence,
    separated_from,
)
from flexclear.pipeline.core.system.errors import SolverError, StoppedError
from flexclear.pipeline.core.system.progress import Progress
from flexclear.pipeline.core.workflow.cores import TICK
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.integrate import recording
from flexclear.pipeline.dynamics.run.evaluation.closure_rows import select_rows
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine, another
from flexclear.pipeline.dynamics.run.evaluation.observation import frames
from flexclear.pipeline.dynamics.run.evaluation.start import per_speed, project, rates_at_speeds
from flexclear.pipeline.dynamics.run.trajectory import Followed, Stop

#: the two are compared at about this many times, which bounds the cost; where outputs are rarer, between them as well
SAMPLES = 180
#: a body's motion counts relative to its own largest, but no less than this fraction of the liveliest body's, below
#: which rounding and the drift of loops move it
LEAST_LIVELY = 1e-3


@dataclass(frozen=True)
class PerturbedRun:
    """Separation of a run and the same run from a perturbed start.

    time [s], separation, a fraction of the largest motion, shape (n,); horizon [s], the start where the perturbed run
    fails.
    """

    time: np.ndarray
    separation: np.ndarray
    horizon: float


@dataclass
class _Seen:
    """One of the two so far. rows: of the record.  motion: at the times of comparison, (times so far, entries)."""

    rows: np.ndarray
    motion: np.ndarray


class Pair:
    """A run and its perturbed run, in two threads with an engine each; a third engine evaluates their rows.

    outputs: times [s] at which both record rows.  added: those of them that the scene does not request.
    """

    def __init__(self, engine: Engine) -> None:
        requested = engine.output_times(engine.model.scene.output.interval)
        self.added = _between(engine, requested)
        self.outputs = np.union1d(requested, self.added)
        self.times = np.union1d(self.outputs[:: max(1, len(self.outputs) // SAMPLES)], self.outputs[-1])
        self._engine, self._looking = another(engine), another(engine)
        self._metric = Metric(engine)
        self._run, self._complete, self._ended = self._unseen(), False, Event()

    def run(self, steps: Callable[[Stop, np.ndarray], Followed]) -> Followed:
        """Result of the run that takes these steps, without the rows that serve comparisons alone."""
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
            self._ended.set()
        return engine, trajectory.without(self.added), switched

    def perturbed_run(
        self, start: np.ndarray, steps: Callable[[Engine, np.ndarray, Stop, np.ndarray], Followed], alive: Progress
    ) -> PerturbedRun:
        """Run the scene again from a start whose contacts are moved, and compare the two.

        steps: takes the same steps as the run, with an engine from a start.  alive: called while it waits for the run;
        what it raises ends the work.
        """
        engine, other, failed = self._engine, self._unseen(), False

        def enough(rows: np.ndarray) -> bool:
            other.rows = rows
            return self._enough(other, alive)

        try:
            select_rows(engine, start, engine.start)
            other.rows = steps(engine, moved_start(engine, start), enough, self.outputs)[1].rows
        except SolverError:
            failed = True
        self._await_run(alive)
        time, separation, horizon = self._compared(other)
        if failed and horizon is None:
            # a neighbour that cannot be run says nothing for the run itself: no value is predictable
            return PerturbedRun(np.array([engine.start]), np.zeros(1), engine.start)
        return PerturbedRun(time, separation, engine.end if horizon is None else horizon)

    def _hear(self, rows: np.ndarray) -> bool:
        """Note the rows that the run has so far; it continues."""
        self._run.rows = rows
        return False

    def _enough(self, other: _Seen, alive: Progress) -> bool:
        """Whether the two have diverged, so that the horizon is known.

        What counts depends on the largest motion of the whole run. Where the two have diverged by the largest one
        so far, the perturbed run waits for the run to end instead of going on, since that seldom changes.
        """
        if not self._beyond(other):
            return False
        self._await_run(alive)
        return self._complete and self._beyond(other)

    def _beyond(self, other: _Seen) -> bool:
        """Whether the two have diverged for long enough, by what is known of the run."""
        self._look(self._run)
        self._look(other)
        first = self._diverged(self._separation(other))
        return first is not None and bool(other.rows[-1, 0] >= self._judged(first))

    def _await_run(self, alive: Progress) -> None:
        """Wait for the end of the run; one that fails before it begins has none."""
        while not self._ended.wait(TICK):
            alive(None, "")

    def _compared(self, other: _Seen) -> tuple[np.ndarray, np.ndarray, float | None]:
        """Times of comparison [s], separation and the horizon [s], when both have ended; None where they stay close."""
        self._look(self._run)
        self._look(other)
        separation = self._separation(other)
        time, diverged = self.times[: len(separation)], self._diverged(separation)
        if diverged is not None:
            shown = time <= self._judged(diverged)
            time, separation = time[shown], separation[shown]
        k = separated_from(time, separation, self._span)
        if k is None:
            return time, separation, None
        finer = self.outputs[(self.outputs > self.times[max(k - 1, 0)]) & (self.outputs < self.times[k])]
        here, there = self._motion(self._run.rows, finer), self._motion(other.rows, finer)
        between = self._metric.distance(here, there, self._largest())
        first = np.flatnonzero(between > SEPARATED)[:1]
        horizon = float(finer[first[0]] if len(first) else time[k])
        return np.insert(time, k, finer[first]), np.insert(separation, k, between[first]), horizon

    def _diverged(self, separation: np.ndarray) -> int | None:
        """Index of the comparison from which on the two diverge."""
        return divergence(self.times[: len(separation)], separation, self._span)

    def _judged(self, k: int) -> float:
        """Time [s] up to which a divergence that begins at comparison k is examined."""
        return min(float(self.times[k]) + LASTING * self._span, float(self.times[-1]))

    @property
    def _span(self) -> float:
        return self._engine.end - self._engine.start

    def _unseen(self) -> _Seen:
        model = self._looking.model
        return _Seen(recording.empty_record(0, len(model.contacts), model.ny), np.zeros((0, self._metric.entries)))

    def _look(self, seen: _Seen) -> None:
        """Add the motion at the times of comparison that a run has come to since the last look."""
        rows = seen.rows
        if len(rows):
            reached = int(np.searchsorted(self.times, rows[-1, 0], side="right"))
            new = self._motion(rows, self.times[len(seen.motion) : reached])
            seen.motion = np.concatenate([seen.motion, new])

    def _motion(self, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Motion at times of which there are rows, shape (time, entries)."""
        return self._metric.motion(self._looking, rows[np.searchsorted(rows[:, 0], times)])

    def _separation(self, other: _Seen) -> np.ndarray:
        """Separation at the times of comparison that both have come to."""
        both = min(len(self._run.motion), len(other.motion))
        return self._metric.distance(self._run.motion[:both], other.motion[:both], self._largest())

    def _largest(self) -> np.ndarray:
        """Largest motion of each body in the run so far, shape (body,)."""
        return self._metric.norms(self._run.motion).max(axis=0, initial=0.0)


class Metric:
    """The motion of all bodies as entries whose squares add up to twice their kinetic energies.

    Of a body: its centre of mass's velocity times the root of its mass, its angular velocity in its own axes times the
    root of its inertia, and the rates of its modes, which have unit mass. Of flexible bodies the deformation's part of
    the first two is left out: this is a measure of separation, not an energy balance.
    """

    def __init__(self, engine: Engine) -> None:
        model = engine.model
        self._bodies = list[tuple[int, float, np.ndarray, np.ndarray, np.ndarray]]()
        for i, link in enumerate(model.mechanism.links):
            if link.undeformed is not None:
                moments, axes = np.linalg.eigh(link.undeformed.moments)
                turning = axes * np.sqrt(np.maximum(moments, 0.0))
                modes = np.arange(model.nv)[model.numbering.modal_coordinates[i]] if link.flexible else np.zeros(0, int)
                self._bodies.append((i, link.mass, link.undeformed.com, turning, modes))
        sizes = [6 + len(modes) for *_, modes in self._bodies]
        self.entries = sum(sizes)
        self._first = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)

    def motion(self, engine: Engine, rows: np.ndarray) -> np.ndarray:
        """Entries of all bodies in rows of the record [sqrt(J)], shape (row, entries)."""
        seen = frames(engine, rows)
        speeds = recording.record(rows, len(engine.model.contacts)).state[:, engine.model.speeds]
        entries = [np.zeros((len(rows), 0))]
        for i, mass, com, turning, modes in self._bodies:
            R_WB, omega = seen["axes"][:, i], seen["omega"][:, i]
            velocity = seen["velocity"][:, i] + np.cross(omega, R_WB @ com)
            spin = np.einsum("tij,ti->tj", R_WB, omega)
            entries += [np.sqrt(mass) * velocity, spin @ turning, speeds[:, modes]]
        return np.hstack(entries)

    def norms(self, motion: np.ndarray) -> np.ndarray:
        """Root of twice the kinetic energy of each body [sqrt(J)], shape (row, body)."""
        if not len(self._first):
            return np.zeros((len(motion), 0))
        return np.sqrt(np.add.reduceat(motion**2, self._first, axis=1))

    def distance(self, one: np.ndarray, other: np.ndarray, largest: np.ndarray) -> np.ndarray:
        """Largest separation of a body at each time, as a fraction of its largest motion in the run."""
        scale = np.maximum(largest, LEAST_LIVELY * largest.max(initial=0.0))
        return np.asarray((self.norms(one - other)[:, scale > 0.0] / scale[scale > 0.0]).max(axis=1, initial=0.0))


def _between(engine: Engine, requested: np.ndarray) -> np.ndarray:
    """Times [s] between outputs that are rarer than comparisons should be.

    Motions diverge in impacts: outputs as rare as a stroke would show it one stroke late.
    """
    interval = engine.model.scene.output.interval
    parts = int(np.ceil(SAMPLES * interval / (engine.end - engine.start) - 1e-9))
    if parts <= 1:
        return np.zeros(0)
    times = engine.output_times(interval / parts)
    after = np.clip(np.searchsorted(requested, times), 1, len(requested) - 1)
    distance = np.minimum(np.abs(times - requested[after - 1]), np.abs(times - requested[after]))
    return times[distance > 1e-9 * interval / parts]


def offset_jacobian(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Change of the ball-to-socket vectors (world) per change of the positions, closures closed; (3 contacts, nv).

    Of a stop, whose way has no direction in space, its three rows are alike.
    """
    engine.select_pieces_after(engine.start)
    contacts, stops = engine.model.arrays.table(m.CONTACTS), engine.model.arrays.size(m.N_SURFACES)

    def offset_rates(rates: np.ndarray) -> np.ndarray:
        velocity = engine.table(m.SITE_FRAMES)["velocity"]
        offset = velocity[contacts["inner"]] - velocity[contacts["outer"]]
        offset[stops:] = engine.table(m.TOUCH)["rate"][stops:, None]
        return np.asarray(offset).ravel()

    return per_speed(engine, y, offset_rates)


def perturbed(engine: Engine, y: np.ndarray, jacobian: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The start with the balls moved by `offsets` (3 per contact) [m] as nearly as the joints allow."""
    engine.select_pieces_after(engine.start)
    speeds, *_ = np.linalg.lstsq(jacobian, offsets, rcond=1e-9)
    there, nq = y.copy(), engine.model.nq
    there[:nq] += rates_at_speeds(engine, y, speeds)[:nq] - rates_at_speeds(engine, y, 0.0 * speeds)[:nq]
    return project(engine, there)


def moved_start(engine: Engine, y: np.ndarray) -> np.ndarray:
    """The start of a perturbed run: every contact moved by PERTURBATION of its clearance, along no axis."""
    along = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    offsets = [PERTURBATION * contact.joint.clearance * along for contact in engine.model.contacts]
    return perturbed(engine, y, offset_jacobian(engine, y), np.concatenate(offsets))


def askew(count: int) -> np.ndarray:
    """Numbers from -1 to 1 that make a direction which no symmetry of a mechanism has, shape (count,)."""
    return np.asarray(np.sin(1.0 + np.arange(count) * 2.399963))
