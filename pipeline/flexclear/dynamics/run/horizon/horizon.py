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

from flexclear.artifacts.quantities import (
    LASTING,
    PERTURBATION,
    SEPARATED,
    index_of_divergence,
    index_of_separation,
)
from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate import recording
from flexclear.dynamics.run.evaluation.closure_rows import select_rows
from flexclear.dynamics.run.evaluation.engine import Engine, copy_of_engine
from flexclear.dynamics.run.evaluation.observation import frames
from flexclear.dynamics.run.evaluation.start import per_speed, project, rates_at_speeds
from flexclear.dynamics.run.trajectory import Followed, Stop, stop_requested
from flexclear.system.errors import SolverError
from flexclear.system.progress import Progress
from flexclear.workflow.cores import TICK

#: about this many times of comparison, which bounds the cost; with rarer outputs, comparisons are also between them
SAMPLES = 180


@dataclass(frozen=True)
class PerturbedRun:
    """Separation of a run and the same run from a perturbed start.

    time [s]; separation, a fraction of the largest motion, shape (n,); horizon [s], which is the start where the
    perturbed run fails.
    """

    time: np.ndarray
    separation: np.ndarray
    horizon: float


@dataclass
class _Side:
    """Rows and motion so far of one of the two runs; motion: at the times of comparison, (times so far, entries)."""

    rows: np.ndarray
    motion: np.ndarray


class Pair:
    """A run and its perturbed run, in two threads with an engine each; a third engine evaluates their rows.

    outputs: times [s] at which both record rows.  added: those of them that the scene does not request.
    """

    def __init__(self, engine: Engine) -> None:
        requested = engine.output_times(engine.model.scene.output.interval)
        self.added = _times_between(engine, requested)
        self.outputs = np.union1d(requested, self.added)
        self.times = np.union1d(self.outputs[:: max(1, len(self.outputs) // SAMPLES)], self.outputs[-1])
        self._engine, self._observer = copy_of_engine(engine), copy_of_engine(engine)
        self._metric = Metric(engine)
        self._run, self._complete, self._ended = self._no_rows(), False, Event()
        self._between = self._run.rows

    def run(self, steps: Callable[[Stop, np.ndarray], Followed]) -> Followed:
        """Return the result of the run that takes these steps, without the rows that only serve comparisons."""
        try:
            engine, trajectory, switched = steps(self.store_rows, self.outputs)
            self.store_rows(trajectory.rows)
            self._between, self._complete = trajectory.between, True
        finally:
            self._ended.set()
        return engine, trajectory.without(self.added), switched

    def perturbed_run(
        self,
        start: np.ndarray,
        steps: Callable[[Engine, np.ndarray, Stop, np.ndarray], Followed],
        alive: Progress,
        begins: Callable[[], bool] = lambda: True,
    ) -> PerturbedRun:
        """Run the scene again from a start whose contacts are moved, and compare the two.

        steps: takes the same steps as the run, with an engine from a start.  alive: called while the perturbed run
        waits for the run; an exception from it ends the work.  begins: True once it may begin before the run has ended.
        """
        engine, other, failed = self._engine, self._no_rows(), False
        self._await_run(alive, begins)
        if self._ended.is_set() and not self._complete:
            raise SolverError("the run itself has failed")

        def enough(rows: np.ndarray) -> bool:
            other.rows = rows
            return self._enough(other, alive)

        try:
            select_rows(engine, start, engine.start)
            other.rows = steps(engine, moved_start(engine, start), enough, self.outputs)[1].rows
        except SolverError:
            failed = True
        self._await_run(alive)
        time, separation, horizon = self._comparison(other)
        if failed and horizon is None:
            # a perturbed run that fails without separation: no value of the run counts as predictable
            return PerturbedRun(np.array([engine.start]), np.zeros(1), engine.start)
        return PerturbedRun(time, separation, engine.end if horizon is None else horizon)

    def store_rows(self, rows: np.ndarray) -> bool:
        """Store the rows that the run has so far; return True on a request to stop."""
        self._run.rows = rows
        return stop_requested(rows)

    def _enough(self, other: _Side, alive: Progress) -> bool:
        """Return True when the two have diverged, so that the horizon is known.

        The criterion depends on the largest motion of the whole run. Once the two have diverged relative to the largest
        motion so far, the perturbed run waits for the end of the run, since further steps seldom change the result.
        """
        if not self._have_diverged(other):
            return False
        self._await_run(alive)
        return self._complete and self._have_diverged(other)

    def _have_diverged(self, other: _Side) -> bool:
        """Return True when the two have diverged for long enough, relative to the run so far."""
        self._update(self._run)
        self._update(other)
        first = self._diverged(self._separation(other))
        return first is not None and bool(other.rows[-1, 0] >= self._examined_until(first))

    def _await_run(self, alive: Progress, enough: Callable[[], bool] = lambda: False) -> None:
        """Wait for the end of the run, or until `enough`; a run that fails before its first step has no end."""
        while not enough() and not self._ended.wait(TICK):
            alive(None, "")

    def _comparison(self, other: _Side) -> tuple[np.ndarray, np.ndarray, float | None]:
        """Return times of comparison [s], separation, and horizon [s] or None, when both runs have ended."""
        self._update(self._run)
        self._update(other)
        separation = self._separation(other)
        time, diverged = self.times[: len(separation)], self._diverged(separation)
        if diverged is not None:
            shown = time <= self._examined_until(diverged)
            time, separation = time[shown], separation[shown]
        k = index_of_separation(time, separation, self._span)
        if k is None:
            return time, separation, None
        finer = self.outputs[(self.outputs > self.times[max(k - 1, 0)]) & (self.outputs < self.times[k])]
        here, there = self._motion(self._run.rows, finer), self._motion(other.rows, finer)
        between = self._metric.distance(here, there, self._largest())
        first = np.flatnonzero(between > SEPARATED)[:1]
        horizon = float(finer[first[0]] if len(first) else time[k])
        return np.insert(time, k, finer[first]), np.insert(separation, k, between[first]), horizon

    def _diverged(self, separation: np.ndarray) -> int | None:
        """Return the index of the comparison from which on the two diverge."""
        return index_of_divergence(self.times[: len(separation)], separation, self._span)

    def _examined_until(self, k: int) -> float:
        """Return the time [s] up to which a divergence that begins at comparison k is examined."""
        return min(float(self.times[k]) + LASTING * self._span, float(self.times[-1]))

    @property
    def _span(self) -> float:
        return self._engine.end - self._engine.start

    def _no_rows(self) -> _Side:
        model = self._observer.model
        return _Side(recording.empty_record(0, len(model.contacts), model.ny), np.zeros((0, self._metric.entries)))

    def _update(self, seen: _Side) -> None:
        """Add the motion at the times of comparison that a run has reached since the last call."""
        rows = seen.rows
        if len(rows):
            reached = int(np.searchsorted(self.times, rows[-1, 0], side="right"))
            new = self._motion(rows, self.times[len(seen.motion) : reached])
            seen.motion = np.concatenate([seen.motion, new])

    def _motion(self, rows: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Return the motion at times that are times of rows, shape (time, entries)."""
        return self._metric.motion(self._observer, rows[np.searchsorted(rows[:, 0], times)])

    def _separation(self, other: _Side) -> np.ndarray:
        """Return the separation at the times of comparison that both have reached."""
        both = min(len(self._run.motion), len(other.motion))
        return self._metric.distance(self._run.motion[:both], other.motion[:both], self._largest())

    def _largest(self) -> np.ndarray:
        """Return the largest motion of each body in the run so far, shape (body,); between outputs once it is over."""
        both = np.concatenate([self._run.motion, self._metric.motion(self._observer, self._between)])
        return self._metric.norms(both).max(axis=0, initial=0.0)


class Metric:
    """The motion of all bodies as entries whose squares add up to twice their kinetic energies.

    Entries of a body: its centre of mass's velocity times the root of its mass, its angular velocity in its own axes
    times the root of its inertia, and the rates of its modes, which have unit mass. For flexible bodies the
    deformation's part of the first two is left out: this is a measure of separation, not an energy balance.
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
        """Return the entries of all bodies in rows of the record [sqrt(J)], shape (row, entries)."""
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
        """Return the root of twice the kinetic energy of each body [sqrt(J)], shape (row, body)."""
        if not len(self._first):
            return np.zeros((len(motion), 0))
        return np.sqrt(np.add.reduceat(motion**2, self._first, axis=1))

    def distance(self, one: np.ndarray, other: np.ndarray, largest: np.ndarray) -> np.ndarray:
        """Return the largest separation of a body at each time, as a fraction of its largest motion in the run."""
        # 1e-3: a body's motion is relative to its own largest, but at least to this fraction of the liveliest body's;
        # smaller motions are rounding and drift of loops
        scale = np.maximum(largest, 1e-3 * largest.max(initial=0.0))
        return np.asarray((self.norms(one - other)[:, scale > 0.0] / scale[scale > 0.0]).max(axis=1, initial=0.0))


def _times_between(engine: Engine, requested: np.ndarray) -> np.ndarray:
    """Return times [s] of comparison between outputs that are too rare.

    Motions diverge at impacts: with one output per stroke, the divergence would be detected one stroke late.
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
    """Return the derivative of ball-to-socket vectors (world) by the positions, closures closed; (3 contacts, nv).

    The three rows of a stop, whose displacement has no direction in space, are equal.
    """
    engine.select_pieces_after(engine.start)
    contacts, stops = engine.model.arrays.table(m.CONTACTS), engine.model.arrays.size(m.N_SURFACES)

    def offset_rates(rates: np.ndarray) -> np.ndarray:
        velocity = engine.table(m.SITE_FRAMES)["velocity"]
        offset = velocity[contacts["inner"]] - velocity[contacts["outer"]]
        offset[stops:] = engine.table(m.TOUCH)["rate"][stops:, None]
        return np.asarray(offset).ravel()

    return per_speed(engine, y, offset_rates)


def perturbed_start(engine: Engine, y: np.ndarray, jacobian: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return the start with the balls moved by `offsets` (3 per contact) [m] as nearly as the joints allow."""
    engine.select_pieces_after(engine.start)
    speeds, *_ = np.linalg.lstsq(jacobian, offsets, rcond=1e-9)
    there, nq = y.copy(), engine.model.nq
    there[:nq] += rates_at_speeds(engine, y, speeds)[:nq] - rates_at_speeds(engine, y, 0.0 * speeds)[:nq]
    return project(engine, there)


def moved_start(engine: Engine, y: np.ndarray) -> np.ndarray:
    """Return the start of a perturbed run: every contact moved by PERTURBATION of its clearance, along no axis."""
    along = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    offsets = np.outer(PERTURBATION * engine.model.arrays.table(m.CONTACT_NUMBERS)["clearance"], along)
    return perturbed_start(engine, y, offset_jacobian(engine, y), offsets.ravel())


def asymmetric(count: int) -> np.ndarray:
    """Return numbers from -1 to 1 as a direction that no symmetry of a mechanism has, shape (count,)."""
    return np.asarray(np.sin(1.0 + np.arange(count) * 2.399963))
