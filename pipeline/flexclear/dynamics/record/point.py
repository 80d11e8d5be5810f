"""One point of a sweep: a run of which only the requested numbers are computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from flexclear.artifacts import quantities
from flexclear.artifacts.points import Point, Values
from flexclear.artifacts.quantities import SAME_TIME, of_impacts, reduce_series, regular_times
from flexclear.dynamics.model.checks import section_period
from flexclear.dynamics.model.contacts import arms
from flexclear.dynamics.record.dataset import events_of, series, variables_for
from flexclear.dynamics.record.ensemble import ball_offsets, difference_of_starts
from flexclear.dynamics.record.motion import Motions
from flexclear.dynamics.run.evaluation.batched_evaluation import Place, Places
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.start import consistent_start
from flexclear.dynamics.run.horizon.horizon import offset_jacobian, perturbed_start
from flexclear.dynamics.run.horizon.periods import Cursor, parts_of_period, periods
from flexclear.dynamics.run.horizon.repetition import require_periodic
from flexclear.dynamics.run.ledger import require_closed
from flexclear.dynamics.run.progress_rate import DearError, affordable, scene_without_comparison
from flexclear.dynamics.run.run import engines, follow, observe_run, require_shallow, rows_to_judge
from flexclear.dynamics.run.trajectory import Trajectory
from flexclear.scene.load import with_numbers
from flexclear.scene.quantity import MAGNITUDES, Recorded
from flexclear.scene.schema import Ensemble, Scene, Sections
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import Progress, silent

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import Labelled

#: number of outputs at which the energy ledger is checked where only final values are recorded
LOOKS = 50
#: tolerance of the run from which the error is estimated, as a fraction of the point's
TIGHTER = 1e-2
#: number of points that step together, and the least number: of fewer points, each is evaluated alone
TOGETHER, FEWEST = 8, 3


@dataclass
class Runner:
    """Runs points of one family, all edits of one scene with the same bundles, and reuses its first engine.

    recorded: the quantities.  members: number of perturbed starts per point, from number `first` of all starts on;
    0: the scene's start alone.
    error: run each point at a tighter tolerance as well.  scaled: starts differ by what clearances, penetrations and
    the size allow, where the scene has no ensemble; else by the default of ensembles.
    """

    bundles: Mapping[str, Labelled]
    recorded: Sequence[Recorded]
    members: int = 0
    error: bool = False
    first: int = 0
    scaled: bool = True
    engine: Engine | None = None
    _making: Lock = field(default_factory=Lock)
    #: the observed rows of a point are large: one thread at a time holds them in memory
    _observing: Lock = field(default_factory=Lock)

    def run(self, scene: Scene, place: Place | None = None, alive: Progress = silent) -> Point:
        """Run one point; errors from physics or input of this point are reported in the result, not raised.

        place: where its steps may be evaluated together with those of other points, with the same bits.  alive: called
        now and then; an exception from it ends the work.
        """
        scene = with_fewest_outputs(scene, self.recorded)
        try:
            try:
                rows, count = self._rows(scene, place, alive)
            except DearError:
                scene = scene_without_comparison(scene)
                rows, count = self._rows(scene, place, alive)
            values, deviation = _statistics(rows)
            if not self.error:
                return Point(values, {}, deviation, count, members=rows)
            finer = {"solver.rtol": TIGHTER * scene.solver.rtol, "solver.integrator": scene.solver.integrator}
            tight = with_numbers(scene, finer)
            others, more = self._rows(tight, place, alive)
            better, _ = _statistics(others)
        except (SolverError, InputError) as error:
            return Point({}, {}, {}, 0, str(error))
        return Point(values, {name: np.abs(better[name] - v) for name, v in values.items()}, deviation, count + more)

    def places(self, scene: Scene, points: int) -> Places | None:
        """Return places in which points like a scene's step together; None where each is run alone."""
        return Places(TOGETHER, 1) if points >= FEWEST and self._steps_together(scene) else None

    def _steps_together(self, scene: Scene) -> bool:
        if scene.event:
            return False
        try:
            self._engines(with_fewest_outputs(scene, self.recorded))
        except (SolverError, InputError):
            return False  # each point reports the error itself
        return self.engine is not None and self.engine.staged

    def _rows(self, scene: Scene, place: Place | None, alive: Progress) -> tuple[list[Values], int]:
        """Return the recorded values of each start, and the number of evaluations of all."""
        if scene.event:
            return self._over_events(scene, alive)
        engine, other = self._engines(scene)
        # exact: the number of points evaluated together depends on the machine and on their durations
        engine.specialised.exact = True
        engine.specialised.place = place
        if in_sections(self.recorded):
            values, count = _sections(scene, engine, self.recorded, alive)
            return [values], count
        rows, count, judges = list[Values](), 0, affordable(scene)
        for start in self._starts(engine):
            last, trajectory, _ = follow(engine, start, alive, other, judges and judges.run)
            with self._observing:
                rows.append(_recorded_values(scene, last, trajectory, self.recorded))
            count += trajectory.counters["evaluations"]
        return rows, count

    def _over_events(self, scene: Scene, alive: Progress) -> tuple[list[Values], int]:
        """Return the recorded values of a scene with events, from its whole run."""
        if in_sections(self.recorded) or self.members:
            raise InputError("[event]", "a run with events has neither sections nor members", "record other reductions")
        from flexclear.dynamics.events import phases  # here, since a point may have phases, which record runs

        run = phases.run_with_events(scene, self.bundles, alive, affordable(scene))
        time = run["time"].values
        after = np.searchsorted(time, regular_times(scene.time, scene.output) * (1.0 - SAME_TIME))
        values = _values(run, self.recorded, time, np.minimum(after, len(time) - 1))
        return [values], int(run.attrs["evaluations"])

    def _engines(self, scene: Scene) -> tuple[Engine, Callable[[str], Engine]]:
        """Return the engine of a point, and a function that makes engines with another integrator; one at a time."""
        with self._making:
            engine, other = engines(scene, self.bundles, silent, self.engine)
            self.engine = self.engine or engine

        def next_engine(name: str) -> Engine:
            with self._making:
                return other(name)

        return engine, next_engine

    def _starts(self, engine: Engine) -> list[np.ndarray]:
        start, model = consistent_start(engine), engine.model
        if not self.members:
            return [start]
        jacobian = offset_jacobian(engine, start)
        given = model.scene.ensemble or (None if self.scaled else Ensemble())
        offsets = ball_offsets(model, given or difference_of_starts(engine, start), self.first + self.members)
        per_length = np.ones(len(model.contacts)) if given else 1.0 / arms(model.mechanism)
        return [
            perturbed_start(engine, start, jacobian, moved * np.repeat(per_length, 3))
            for moved in list(offsets)[self.first :]
        ]


def _statistics(rows: Sequence[Values]) -> tuple[Values, Values]:
    """Return means over starts and their standard deviations; for one start its values, without deviations."""
    if len(rows) == 1:
        return rows[0], {}
    stacked = {name: np.stack([values[name] for values in rows]) for name in rows[0]}
    deviation = {name: values.std(axis=0, ddof=1) for name, values in stacked.items()}
    return {name: values.mean(axis=0) for name, values in stacked.items()}, deviation


def in_sections(recorded: Sequence[Recorded]) -> bool:
    """Return True when points are periodic motions, sampled once in each period."""
    return any(one.reduction == "sections" for one in recorded)


def with_fewest_outputs(scene: Scene, recorded: Sequence[Recorded]) -> Scene:
    """Return the scene with no more regular outputs than the recorded quantities need."""
    if in_sections(recorded):
        # only the states at the waypoints of a period are examined
        return scene.model_copy(update={"output": scene.output.model_copy(update={"interval": section_period(scene)})})
    if any(one.needs_regular_times for one in recorded):
        return scene
    interval = max(scene.output.interval, (scene.time.end - scene.time.start) / LOOKS)
    return scene.model_copy(update={"output": scene.output.model_copy(update={"interval": interval})})


def _recorded_values(scene: Scene, engine: Engine, trajectory: Trajectory, recorded: Sequence[Recorded]) -> Values:
    seen = observe_run(engine, trajectory)
    require_shallow(engine.model, trajectory, seen)
    require_closed(engine.model, *rows_to_judge(engine, trajectory, seen))
    events = {} if all(one.quantity.over_time for one in recorded) else events_of(engine.model, trajectory)
    terms = {term for one in recorded for term in one.quantity.terms()}
    arrays = variables_for(scene, Motions(engine.model, seen), terms, trajectory.time, events)
    return _values(arrays, recorded, trajectory.time, _regular(engine, trajectory.time))


def _values(run: Labelled, recorded: Sequence[Recorded], time: np.ndarray, regular: np.ndarray) -> Values:
    """Return the recorded values from the variables of a run; regular: rows of the regular output times."""
    values: Values = {}
    for one in recorded:
        if one.quantity.over_time:
            values[one.name] = _reduce_series(one, time, quantities.series(run, one.quantity), regular)
        elif one.reduction == "series":
            values[one.name] = quantities.running_extremes(run, one.quantity, regular, time)
        elif one.quantity.kind == "impact_times":
            values[one.name] = np.asarray(of_impacts(quantities.contact_values(run, one.quantity), one.reduction))
        else:
            values[one.name] = np.asarray(quantities.contact_values(run, one.quantity)[0])
    return values


def _reduce_series(one: Recorded, time: np.ndarray, over_time: np.ndarray, regular: np.ndarray) -> np.ndarray:
    """Return the recorded value of a series, shape (time, ...); regular: rows of the regular output times."""
    value = over_time[regular] if one.reduction == "series" else reduce_series(time, over_time, one.reduction)
    return np.asarray(value if one.quantity.dim or one.reduction in MAGNITUDES else value[..., 0])


def _sections(scene: Scene, engine: Engine, recorded: Sequence[Recorded], alive: Progress) -> tuple[Values, int]:
    """Return the recorded values once per period, after the transient, and the evaluations of all periods."""
    requested, period = scene.sections or Sections(), section_period(scene)
    start, parts = consistent_start(engine), parts_of_period(engine, period, requested.phase)
    require_periodic(parts, start)
    sampled_at = next(k for k, part in enumerate(parts) if part.start == engine.start + requested.phase)
    values, evaluations = dict[str, list[np.ndarray]](), 0
    for done in periods(parts, start, range(0), Cursor()):
        alive(None, f"period {done.number}")
        evaluations += sum(trajectory.counters["evaluations"] for trajectory in done.parts)
        if done.number >= requested.transient:
            here = done.parts[sampled_at]
            motions = Motions(engine.model, observe_run(parts[sampled_at], replace(here, rows=here.rows[:1])))
            known = series(scene, motions, {one.quantity for one in recorded}, here.time[:1])
            for one in recorded:
                row = known[one.quantity.name][0]
                values.setdefault(one.name, []).append(row if one.quantity.dim else row[0])
        if done.number + 1 == requested.transient + requested.periods:
            break
    return {name: np.array(rows) for name, rows in values.items()}, evaluations


def _regular(engine: Engine, time: np.ndarray) -> np.ndarray:
    """Return the rows at the regular output times; a break that replaces one differs only by rounding."""
    requested = regular_times(engine.model.scene.time, engine.model.scene.output)
    after = np.clip(np.searchsorted(time, requested), 1, len(time) - 1)
    nearer = np.where(np.abs(time[after - 1] - requested) < np.abs(time[after] - requested), after - 1, after)
    return np.asarray(nearer)
