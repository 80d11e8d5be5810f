"""One point of a sweep: a run of which only the recorded numbers are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.artifacts import quantities
from flexclear.pipeline.core.artifacts.points import Point, Values
from flexclear.pipeline.core.artifacts.quantities import IMPACT, SAME_TIME, of_impacts, reduced, regular_times
from flexclear.pipeline.core.scene.event_kinds import CLOSING
from flexclear.pipeline.core.scene.load import with_numbers
from flexclear.pipeline.core.scene.quantity import MAGNITUDES, Recorded
from flexclear.pipeline.core.scene.registry import lookup
from flexclear.pipeline.core.scene.schema import Ensemble, Scene, Sections
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.core.system.progress import Progress, silent
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.effects import EVENTS
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.contacts import arms
from flexclear.pipeline.dynamics.record.dataset import series
from flexclear.pipeline.dynamics.record.ensemble import ball_offsets, difference_of_starts
from flexclear.pipeline.dynamics.record.motion import Motions
from flexclear.pipeline.dynamics.record.sections import section_period
from flexclear.pipeline.dynamics.run.alike import engines_alike
from flexclear.pipeline.dynamics.run.evaluation.batched_evaluation import Place, Places
from flexclear.pipeline.dynamics.run.evaluation.engine import Engine
from flexclear.pipeline.dynamics.run.evaluation.start import consistent_start
from flexclear.pipeline.dynamics.run.horizon.horizon import offset_jacobian, perturbed
from flexclear.pipeline.dynamics.run.horizon.periods import Cursor, periods, require_periodic, stretches
from flexclear.pipeline.dynamics.run.ledger import require_closed
from flexclear.pipeline.dynamics.run.progress_rate import DearError, affordable, unverified
from flexclear.pipeline.dynamics.run.run import follow, observed, require_shallow
from flexclear.pipeline.dynamics.run.trajectory import Trajectory

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import Labelled

#: where only final values are recorded, the ledger of energy is examined so often
LOOKS = 50
#: how much tighter the tolerance of the run is by which the error is estimated
TIGHTER = 1e-2
#: points that step side by side, and the fewest that do: of less, each is evaluated alone all the same
TOGETHER, FEWEST = 8, 3


@dataclass
class Runner:
    """Runs points of one family, all edits of one scene with the same bundles; keeps the engine that it made first.

    recorded: the quantities.  members: starts of each point that differ by a hair; 0: the one of the scene.
    error: whether each point is run at a tighter tolerance as well.  scaled: whether starts differ by what clearances,
    depths and the size allow, where the scene has no ensemble; else by the default of ensembles.
    """

    bundles: Mapping[str, Labelled]
    recorded: Sequence[Recorded]
    members: int = 0
    error: bool = False
    scaled: bool = True
    engine: Engine | None = None
    _making: Lock = field(default_factory=Lock)
    #: what is seen of all rows is large, and seen in turn it is there once
    _looking: Lock = field(default_factory=Lock)

    def run(self, scene: Scene, place: Place | None = None, alive: Progress = silent) -> Point:
        """One point; what physics or the input of this point refuses is reported in the point, not raised.

        place: where its steps may be taken next to those of other points, which changes no bit of it.  alive: called
        now and then; what it raises ends the work.
        """
        scene = thinned(scene, self.recorded)
        try:
            try:
                rows, count = self._rows(scene, place, alive)
            except DearError:
                scene = unverified(scene)
                rows, count = self._rows(scene, place, alive)
            values, deviation = _statistics(rows)
            if not self.error:
                return Point(values, {}, deviation, count, members=rows)
            tight = with_numbers(scene, {"solver.rtol": TIGHTER * scene.solver.rtol})
            others, more = self._rows(tight, place, alive)
            better, _ = _statistics(others)
        except (SolverError, InputError) as error:
            return Point({}, {}, {}, 0, str(error))
        return Point(values, {name: np.abs(better[name] - v) for name, v in values.items()}, deviation, count + more)

    def places(self, scene: Scene, points: int) -> Places | None:
        """Where so many points like that of a scene may step together; None where each is to be run alone."""
        return Places(TOGETHER, 1) if points >= FEWEST and self._steps_together(scene) else None

    def _steps_together(self, scene: Scene) -> bool:
        if scene.event:
            return False
        try:
            self._engines(thinned(scene, self.recorded))
        except (SolverError, InputError):
            return False  # as each point reports by itself
        return self.engine is not None and self.engine.staged

    def _rows(self, scene: Scene, place: Place | None, alive: Progress) -> tuple[list[Values], int]:
        """Recorded values of each start, and the evaluations of all."""
        if scene.event:
            return self._over_events(scene, alive)
        engine, other = self._engines(scene)
        # exact, since how many points are run side by side depends on the machine and on how long they take
        engine.straight.exact = True
        engine.straight.place = place
        if in_sections(self.recorded):
            values, count = _sections(scene, engine, self.recorded, alive)
            return [values], count
        rows, count, judges = list[Values](), 0, affordable(scene)
        for start in self._starts(engine):
            last, trajectory, _ = follow(engine, start, alive, other, judges and judges.run)
            with self._looking:
                rows.append(_kept(scene, last, trajectory, self.recorded))
            count += trajectory.counters["evaluations"]
        return rows, count

    def _over_events(self, scene: Scene, alive: Progress) -> tuple[list[Values], int]:
        """Recorded values of a scene with events, read from its whole run."""
        if in_sections(self.recorded) or self.members:
            raise InputError("[event]", "a run with events has neither sections nor members", "record other reductions")
        run = lookup(EVENTS, "phases", where="[event]")(scene, self.bundles, alive, affordable(scene))
        time = run["time"].values
        after = np.searchsorted(time, regular_times(scene.time, scene.output) * (1.0 - SAME_TIME))
        values: Values = {}
        for one in self.recorded:
            if one.quantity.over_time:
                over_time = quantities.series(run, one.quantity)
                values[one.name] = _recorded(one, time, over_time, np.minimum(after, len(time) - 1))
            elif one.quantity.kind == "impact_times":
                values[one.name] = np.asarray(of_impacts(quantities.events(run, one.quantity), one.reduction))
            else:
                values[one.name] = np.asarray(quantities.events(run, one.quantity)[0])
        return [values], int(run.attrs["evaluations"])

    def _engines(self, scene: Scene) -> tuple[Engine, Callable[[str], Engine]]:
        """What runs a point, and the maker of what continues with another integrator; made one at a time."""
        with self._making:
            engine, other = engines_alike(self.engine, scene, self.bundles)
            self.engine = self.engine or engine

        def heir(name: str) -> Engine:
            with self._making:
                return other(name)

        return engine, heir

    def _starts(self, engine: Engine) -> list[np.ndarray]:
        start, model = consistent_start(engine), engine.model
        if not self.members:
            return [start]
        jacobian = offset_jacobian(engine, start)
        given = model.scene.ensemble or (None if self.scaled else Ensemble())
        offsets = ball_offsets(model, given or difference_of_starts(engine, start), self.members)
        per_length = np.ones(len(model.contacts)) if given else 1.0 / arms(model)
        return [perturbed(engine, start, jacobian, moved * np.repeat(per_length, 3)) for moved in offsets]


def _statistics(rows: Sequence[Values]) -> tuple[Values, Values]:
    """Means over starts and their standard deviations; of one start its values alone."""
    if len(rows) == 1:
        return rows[0], {}
    stacked = {name: np.stack([values[name] for values in rows]) for name in rows[0]}
    deviation = {name: values.std(axis=0, ddof=1) for name, values in stacked.items()}
    return {name: values.mean(axis=0) for name, values in stacked.items()}, deviation


def in_sections(recorded: Sequence[Recorded]) -> bool:
    """Whether points are motions that their laws repeat, sampled once in each period."""
    return any(one.reduction == "sections" for one in recorded)


def thinned(scene: Scene, recorded: Sequence[Recorded]) -> Scene:
    """The scene with no more regular outputs than the recorded quantities need."""
    if in_sections(recorded):
        # only the states between the stretches of a period are examined
        return scene.model_copy(update={"output": scene.output.model_copy(update={"interval": section_period(scene)})})
    if any(one.throughout for one in recorded):
        return scene
    interval = max(scene.output.interval, (scene.time.end - scene.time.start) / LOOKS)
    return scene.model_copy(update={"output": scene.output.model_copy(update={"interval": interval})})


def _kept(scene: Scene, engine: Engine, trajectory: Trajectory, kept: Sequence[Recorded]) -> Values:
    seen = observed(engine, trajectory)
    require_shallow(engine.model, trajectory, seen)
    require_closed(engine.model, trajectory, seen)
    over_time = {one.quantity for one in kept if one.quantity.over_time}
    known = series(scene, Motions(engine.model, seen), over_time, trajectory.time)
    values: Values = {}
    for one in kept:
        if one.quantity.over_time:
            regular = _regular(engine, trajectory.time)
            values[one.name] = _recorded(one, trajectory.time, known[one.quantity.name], regular)
        else:
            values[one.name] = np.asarray(_of_contact(engine, trajectory, seen, one))
    return values


def _recorded(one: Recorded, time: np.ndarray, over_time: np.ndarray, regular: np.ndarray) -> np.ndarray:
    """What is recorded of a series, shape (time, ...); regular: rows of the regular output times."""
    value = over_time[regular] if one.reduction == "series" else reduced(time, over_time, one.reduction)
    return np.asarray(value if one.quantity.dim or one.reduction in MAGNITUDES else value[..., 0])


def _sections(scene: Scene, engine: Engine, recorded: Sequence[Recorded], alive: Progress) -> tuple[Values, int]:
    """Recorded values, once in each period, after the transient, and the evaluations that all periods took."""
    requested, period = scene.sections or Sections(), section_period(scene)
    start, parts = consistent_start(engine), stretches(engine, period, requested.phase)
    require_periodic(parts, start)
    sampled_at = next(k for k, part in enumerate(parts) if part.start == engine.start + requested.phase)
    values, evaluations = dict[str, list[np.ndarray]](), 0
    for done in periods(parts, start, range(0), Cursor()):
        alive(None, f"period {done.number}")
        evaluations += sum(trajectory.counters["evaluations"] for trajectory in done.parts)
        if done.number >= requested.transient:
            here = done.parts[sampled_at]
            motions = Motions(engine.model, observed(parts[sampled_at], replace(here, rows=here.rows[:1])))
            known = series(scene, motions, {one.quantity for one in recorded}, here.time[:1])
            for one in recorded:
                row = known[one.quantity.name][0]
                values.setdefault(one.name, []).append(row if one.quantity.dim else row[0])
        if done.number + 1 == requested.transient + requested.periods:
            break
    return {name: np.array(rows) for name, rows in values.items()}, evaluations


def _of_contact(engine: Engine, trajectory: Trajectory, seen: Observed, one: Recorded) -> float:
    contact = [c.name for c in engine.model.contacts].index(one.quantity.owner)
    if one.quantity.kind == "impulse":
        ledger = seen.state[-1, engine.model.speeds.stop :]
        slots = ledger[m.CONTACT_SLOTS : m.CONTACT_SLOTS + m.CONTACT_LEDGER.size * len(engine.model.contacts)]
        return float(m.named(m.CONTACT_LEDGER, slots[None])["impulse"][0, contact])
    events = trajectory.events
    closings = events[(events["contact"] == contact) & (events["kind"] == CLOSING)]
    if one.quantity.kind == "peak_force":
        return float(closings["peak_force"].max(initial=0.0))
    return of_impacts(closings["time"][closings["speed"] > IMPACT], one.reduction)


def _regular(engine: Engine, time: np.ndarray) -> np.ndarray:
    """Rows at the regular output times; a break that replaces one is the same but for rounding."""
    requested = regular_times(engine.model.scene.time, engine.model.scene.output)
    after = np.clip(np.searchsorted(time, requested), 1, len(time) - 1)
    nearer = np.where(np.abs(time[after - 1] - requested) < np.abs(time[after] - requested), after - 1, after)
    return np.asarray(nearer)
