"""Run of a scene with events: phase after phase, each from the state and the scene that the event left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from flexclear.artifacts.labelled import Labelled, LabelledArrays
from flexclear.dynamics.equations.observation import Observed
from flexclear.dynamics.events.carried import carry_internal_states, with_closed_contacts
from flexclear.dynamics.events.changes import (
    coordinates_of_event,
    rates,
    with_drives_of_event,
    with_switched_load,
    without_drives,
    without_released_part,
)
from flexclear.dynamics.events.impulse import apply_impulses, rows
from flexclear.dynamics.events.joined import Happened, Phase, join_phases, stored_energies
from flexclear.dynamics.events.watch import Watch
from flexclear.dynamics.record.dataset import warnings
from flexclear.dynamics.run.coordinates import joint_coordinates
from flexclear.dynamics.run.evaluation.engine import Engine
from flexclear.dynamics.run.evaluation.observation import observe
from flexclear.dynamics.run.evaluation.start import consistent_start, mends
from flexclear.dynamics.run.ledger import require_closed
from flexclear.dynamics.run.progress_rate import Judge, Judges, Panel, crawls
from flexclear.dynamics.run.run import Run, follow, maker, observe_run, require_shallow
from flexclear.dynamics.run.trajectory import SLICE, Followed, Stop, Trajectory, never
from flexclear.dynamics.starts.snapshot import with_poses_and_velocities
from flexclear.scene.events import Event
from flexclear.scene.quantity import Quantity, parse_condition
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError, StoppedError, refuse
from flexclear.system.progress import Progress

#: evaluations between checks of the conditions; where a run fails after an event, the smaller number
PAUSES = (2_000, 50)
#: an event nearer than this fraction of the run to its end does not happen
END = 1e-12


@dataclass(frozen=True)
class _Start:
    """Start of a phase; scene: with the bodies as they are then, and with times up to the end of the run.

    before: engine and state at the end of the previous phase; None for the first one.
    """

    scene: Scene
    before: tuple[Engine, np.ndarray] | None = None


def run_with_events(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, judges: Judges | None = None
) -> LabelledArrays:
    """Return the run of a scene with events (schema RUN).

    Raises InputError for events that cannot happen as intended, SolverError when the run cannot continue.
    """
    plan = _Plan(scene, bundles, progress, judges.run if judges is not None else None)
    start, phases, waiting = _Start(scene.model_copy(update={"event": {}})), list[Phase](), dict(scene.event)
    while True:
        with _in_words(phases):
            phase, event, after = plan.phase(start, waiting, phases)
        phases.append(phase)
        if event is None or after is None:
            break
        del waiting[event]
        with _in_words(phases):
            start, happened = plan.changed(event, *after, phase)
        phases[-1] = replace(phase, happened=happened)
        progress(None, f"at t = {phase.end:.6g} s: {event} ({happened.kind})")
    notes = [f"event {name} did not happen in this run" for name in waiting]
    if scene.contacts() or scene.stops():
        notes.append("no predictability horizon with events: repeat the run from a perturbed start to estimate one")
    for note in notes:
        progress(None, f"warning: {note}")
    return join_phases(scene, phases, notes)


def require_false(scene: Scene, engine: Engine, y: np.ndarray) -> None:
    """Raise InputErrors for events whose conditions are true in the state y at the start of the run."""
    _refuse_true(Watch(engine, y, _conditions_of_events(scene, _due_events(scene.event)), {}), scene.event)


def _due_events(waiting: Mapping[str, Event]) -> dict[str, Event]:
    """Return the events that wait for no other one."""
    return {name: event for name, event in waiting.items() if not event.before & waiting.keys()}


def _conditions_of_events(scene: Scene, due: Mapping[str, Event]) -> dict[str, Quantity]:
    owners = scene.owners()
    return {name: parse_condition(str(e.at), owners) for name, e in due.items() if not isinstance(e.at, float)}


def _refuse_true(watch: Watch, events: Mapping[str, Event]) -> None:
    problem, remedy = "is already true at the start of the run", "reverse the comparison, or correct the event's change"
    refuse([InputError(f"[event.{name}.at]", f"'{events[name].at}' {problem}", remedy) for name in watch.held])


@contextmanager
def _in_words(phases: list[Phase]) -> Iterator[None]:
    """Name the last event in errors of the scene that it has left."""
    last = next((phase.happened.name for phase in reversed(phases) if phase.happened is not None), None)
    try:
        yield
    except InputError as error:
        if last is None or error.place.startswith("[event."):
            raise
        text = f"the scene after the event cannot be continued: {error.place} {error.problem}"
        raise InputError(f"[event.{last}]", text, error.remedy) from None


@dataclass(frozen=True)
class _Plan:
    """Data common to all phases of a run."""

    scene: Scene
    bundles: Mapping[str, Labelled]
    progress: Progress
    panel: Panel | None

    def phase(
        self, start: _Start, waiting: Mapping[str, Event], before: list[Phase]
    ) -> tuple[Phase, str | None, tuple[Scene, Engine, np.ndarray] | None]:
        """Return a phase, the event that ends it, and scene, engine and state there; both None in the last phase."""
        t, end = start.scene.time.start, self.scene.time.end
        due = _due_events(waiting)
        timed = {n: max(e.at, t) for n, e in due.items() if isinstance(e.at, float)}
        first = min(timed, key=timed.__getitem__, default=None)
        until = end if first is None else timed[first]
        scene = start.scene.model_copy(
            update={"time": start.scene.time.model_copy(update={"end": max(until, t + END * (end - t))})}
        )
        made = maker(scene, self.bundles, self.progress)
        engine = made()
        y = consistent_start(engine)
        mended = tuple(mends(engine, y)) if start.before is None else ()
        known = before[-1].coordinates if before else {}
        if start.before is not None:
            y = carry_internal_states(start.before[0].model, start.before[1], engine.model, y, known)
        conditions = _conditions_of_events(self.scene, due)
        watch = Watch(engine, y, conditions, known)
        begins = _energies(engine, y, t)
        phase = Phase(None, t, begins, begins, watch.coordinates)
        if start.before is None:
            _refuse_true(watch, waiting)
        at_once = watch.held[0] if watch.held else first if until <= t else None
        if at_once is not None:
            return phase, at_once, (scene, engine, y)
        last, trajectory, switched, event = self._followed(engine, made, y, watch, bool(conditions))
        event = first if event is None and first is not None and until < end else event
        seen = observe_run(last, trajectory)
        require_shallow(last.model, trajectory, seen)
        run = Run(scene, last, trajectory, seen, None, switched, mended)
        exchanged = require_closed(last.model, *run.judged, max((p.exchanged for p in before), default=0.0))
        for sentence in warnings(run) if start.before is None else ():
            self.progress(None, f"warning: {sentence}")
        t = float(trajectory.time[-1])
        state = trajectory.state[-1].copy()
        series = joint_coordinates(last.model, seen)
        shift = {n: watch.coordinates[n] - float(v[0][0]) for n, v in series.items()}
        phase = replace(
            phase,
            run=run,
            end=t,
            ends=_last_values(stored_energies(last.model, seen)),
            coordinates={n: float(v[0][-1]) + shift[n] for n, v in series.items()},
            exchanged=exchanged,
        )
        return phase, event, (scene, last, state) if event is not None else None

    def _followed(
        self, engine: Engine, made: Callable[..., Engine], y: np.ndarray, watch: Watch, watched: bool
    ) -> tuple[Engine, Trajectory, str, str | None]:
        """Return the trajectory to the end of a phase, and the event whose condition ends it."""
        times = engine.output_times(self.scene.output.interval, self.scene.time.start)
        if not watched:
            return *self._steps(engine, made, y, never, times, SLICE), None
        span = self.scene.time.end - self.scene.time.start
        # least number of times at which conditions are examined
        looks = np.linspace(engine.start, engine.end, 2 + int(500 * (engine.end - engine.start) / span))
        done: Followed | None = None
        for pause in PAUSES:
            try:
                done = self._steps(engine, made, y, watch.stop, np.union1d(times, looks), pause)
                watch.examine(done[1].rows)
            except SolverError as error:
                if isinstance(error, StoppedError) or (pause == PAUSES[-1] and watch.hit is None):
                    raise
            if done is not None or watch.hit is not None:
                break
        event, until = watch.hit or (None, engine.end)
        if event is not None and until >= engine.end - END * span:
            event, until = None, engine.end
        short = replace(engine, end=until)
        times = short.output_times(self.scene.output.interval, self.scene.time.start)
        return *self._steps(short, lambda n, p: replace(made(n, p), end=until), y, never, times, SLICE), event

    def _steps(
        self,
        engine: Engine,
        made: Callable[..., Engine],
        y: np.ndarray,
        stop: Stop,
        times: np.ndarray,
        pause: int,
    ) -> Followed:
        begun, span = self.scene.time.start, self.scene.time.end - self.scene.time.start

        def tell(fraction: float | None, text: str) -> None:
            """Report progress as a fraction of the whole run."""
            at = engine.start + (engine.end - engine.start) * (fraction or 0.0)
            self.progress(None if fraction is None else (at - begun) / span, text)

        name = engine.model.scene.solver.integrator
        usual = Judge(None, crawls), engine.method.traits.hands_over_to
        judge, heir = (self.panel or {}).get(name, usual)
        panel = {**(self.panel or {}), name: (replace(judge, every=min(judge.every or SLICE, pause)), heir)}
        return follow(engine, y, tell, lambda other: made(other, tell), panel, stop, times)

    def changed(self, name: str, scene: Scene, engine: Engine, y: np.ndarray, phase: Phase) -> tuple[_Start, Happened]:
        """Return the start of the next phase after an event, and the record of the event."""
        event, t = self.scene.event[name], phase.end
        still = with_poses_and_velocities(with_closed_contacts(scene, engine), engine, y, t)
        start = still.start.model_copy(update={"branch": ()}) if still.start is not None else None
        still = still.model_copy(update={"start": start, "time": self.scene.time.model_copy(update={"start": t})})
        if event.kind == "release":
            return _Start(without_released_part(still, event), (engine, y)), Happened(name, event.kind, t)
        held, (family, part) = coordinates_of_event(still, name, event), event.part
        if family == "load" and part in still.load:
            return _Start(with_switched_load(still, event, t), (engine, y)), Happened(name, event.kind, t)
        if not held:
            raise InputError(
                f"[event.{name}.{event.kind}]",
                f"{family}.{part} is released by an earlier event",
                "remove one of the two events",
            )
        free = without_drives(still, held)
        after = with_drives_of_event(free, event, held, phase.coordinates, t)
        other = maker(free, self.bundles, self.progress)()
        struck = apply_impulses(other, consistent_start(other), t, rates(after, held, t))
        moved = with_poses_and_velocities(free, other, struck.y, t)
        after = after.model_copy(update={"body": moved.body, "start": moved.start})
        impulse = next(iter(struck.impulses.values())) if len(held) == 1 else np.nan
        return _Start(after, (engine, y)), Happened(name, event.kind, t, impulse, struck.work, held[0].turns)


def _energies(engine: Engine, y: np.ndarray, t: float) -> dict[str, float]:
    """Return the energies of a start state [J]."""
    engine.select_pieces_after(t)
    seen: Observed = observe(engine, rows(engine, y[None], t), after=True)
    return _last_values(stored_energies(engine.model, seen))


def _last_values(series: Mapping[str, np.ndarray]) -> dict[str, float]:
    return {name: float(values[-1]) for name, values in series.items()}
