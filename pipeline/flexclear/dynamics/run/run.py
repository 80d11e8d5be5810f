"""One run from scene to observed rows; an implicit method continues where an explicit one would be too slow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from flexclear.artifacts.labelled import Labelled
from flexclear.dynamics import memory as m
from flexclear.dynamics.drives.pieces import Pieces
from flexclear.dynamics.effects import scheme_of
from flexclear.dynamics.equations import observation
from flexclear.dynamics.equations.observation import Blocks, Observed
from flexclear.dynamics.model.checks import mechanism_errors
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.model.model import Model, tabulate
from flexclear.dynamics.model.plausibility import start_errors
from flexclear.dynamics.model.refill import refill_model
from flexclear.dynamics.run import trajectory as stepping
from flexclear.dynamics.run.evaluation.engine import Engine, assemble, copy_of_engine, prepare
from flexclear.dynamics.run.evaluation.observation import observe_blocks
from flexclear.dynamics.run.evaluation.start import consistent_start, mends
from flexclear.dynamics.run.horizon.horizon import Pair
from flexclear.dynamics.run.ledger import require_closed
from flexclear.dynamics.run.progress_rate import Judges, Panel
from flexclear.dynamics.run.singular_poses import collocation
from flexclear.dynamics.run.trajectory import Followed, StiffError, Stop, Trajectory, never, stop_requested
from flexclear.scene.drives import PathDrive
from flexclear.scene.load import edited
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError, StoppedError, errors_of, refuse
from flexclear.system.progress import Progress
from flexclear.workflow import stopping
from flexclear.workflow.cores import run_in_thread

if TYPE_CHECKING:
    from flexclear.dynamics.run.horizon.horizon import PerturbedRun
    from flexclear.dynamics.run.singular_poses.collocation import Collocation

#: outputs by which runs are judged
JUDGED = ["state", "positions", "links", "link_wrenches", "touch", "loads", "energy", "residual"]


@dataclass(frozen=True)
class Run:
    """A finished integration.

    scene: as the user gave it; the engine may have an edited one.
    perturbed: the same run from a perturbed start, for scenes with contacts.
    mended: differences of the start from the scene's, in words.
    switched: time and reason of the change to another integrator; empty without a change.
    stopped: why it ended before its time, or lacks its perturbed run; empty for a complete run.
    """

    scene: Scene
    engine: Engine
    trajectory: Trajectory
    observed: Observed
    perturbed: PerturbedRun | None = None
    switched: str = ""
    mended: tuple[str, ...] = ()
    stopped: str = ""

    @property
    def model(self) -> Model:
        """Model of the run."""
        return self.engine.model

    @cached_property
    def judged(self) -> tuple[Trajectory, Observed]:
        """The rows by which the run is judged (`rows_to_judge`)."""
        return rows_to_judge(self.engine, self.trajectory, self.observed)


def engine_of(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> Engine:
    """Return the compiled engine of a scene at the begin of its run; paths are not solved for."""
    return prepare(tabulate(build(with_start_state(scene, bundles, progress)[0], bundles)), progress)


def scene_in_place(scene: Scene) -> Scene:
    """Return the scene with bodies positioned by joints and drives at the begin of the run, if it begins elsewhere."""
    if scene.start is None or scene.start.begins is None:
        return scene
    from flexclear.dynamics.starts import STARTS  # here, since runs start with runs

    return STARTS[scene.start.begins].with_placing_joints(scene)


def with_driven_actuators(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress
) -> tuple[Scene, Mapping[str, Pieces]]:
    """Return the scene whose actuators are driven so that they produce the given paths, and the actuators' laws."""
    if not any(isinstance(drive, PathDrive) and drive.actuators for drive in scene.drive.values()):
        return scene, {}
    from flexclear.dynamics.run.inverse import scene_with_actuators  # here, since it imports SciPy

    return scene_with_actuators(scene, bundles, progress)


def with_start_state(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> tuple[Scene, str]:
    """Return the scene with the poses and velocities of its `[start]`.

    Return also which of several assemblies was chosen, in words; empty when there is one, or the scene chooses.
    """
    if scene.start is None or scene.start.begins is None:
        return scene, ""
    from flexclear.dynamics.starts import STARTS

    return STARTS[scene.start.begins].begin(scene, bundles, progress)


def engines(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, known: Engine | None = None
) -> tuple[Engine, Callable[[str], Engine]]:
    """Return the engine of a run, and a function that makes an engine for another integrator, by name; known: as of
    `maker`."""
    made = maker(scene, bundles, progress, known)
    return made(), cache(made)


def maker(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, known: Engine | None = None
) -> Callable[..., Engine]:
    """Return a function that makes the engine of a run for an integrator's name, by default the scene's.

    known: engine of another edit with the same bundles. Its compiled functions and checks serve the new one where they
    can, with equal results to the last bit.
    """
    alike = None if known is None or not _may_serve(known, scene) else refill_model(known.model, scene)
    if known is not None and alike is not None:
        same = partial(assemble, alike, known.entry, known.method, known.mobility)
        return lambda name="", tell=progress: maker(scene, bundles, tell)(name) if name else same()
    try:
        posed, choice = with_start_state(scene, bundles, progress)
    except InputError as error:  # of a mechanism that has ideal joints, perhaps
        both = (*mechanism_errors(scene, build(scene, bundles)), *errors_of(error))
        refuse([*{str(one): one for one in both}.values()])
        raise
    moved, given = with_driven_actuators(posed, bundles, progress)
    making = Lock()  # a run and its perturbed run may both continue with another integrator

    def made(name: str = "", tell: Progress = progress) -> Engine:
        requested = edited(moved, {"solver.integrator": name}) if name else moved
        with making:
            model = tabulate(build(requested, bundles), given)
            refuse([*mechanism_errors(model.scene, model.mechanism), *start_errors(model.mechanism)])
            if choice:  # the poses found no longer describe it
                model = replace(model, mechanism=replace(model.mechanism, choice=choice))
            return prepare(model, tell)

    return made


def _may_serve(known: Engine, scene: Scene) -> bool:
    """Return True when the scene uses the same compiled functions, needs no preceding run, and starts ordinarily."""
    old = known.model.scene
    paths = any(isinstance(drive, PathDrive) for drive in [*old.drive.values(), *scene.drive.values()])
    return not paths and scheme_of(scene.solver) == scheme_of(old.solver) and not known.mobility.singular_start


def integrate(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> Run:
    """Return the complete run of `RunInParts`; raise StoppedError on a request to stop."""
    run = RunInParts(scene, bundles, progress).whole()
    if run.stopped:
        raise stopping.stopping_error(run.stopped)
    return run


class RunInParts:
    """Start, integration and observation of a scene, up to a time or to the end; actuators of a path are driven so that
    they produce it. It continues where it paused, with the same steps as in one go."""

    def __init__(
        self,
        scene: Scene,
        bundles: Mapping[str, Labelled],
        progress: Progress,
        judges: Judges | None = None,
        known: Engine | None = None,
    ) -> None:
        """Build and start a scene.

        bundles: reduced flexible bodies by name.  judges: decide whether another integrator continues; by default
        explicit methods hand over when they would be too slow.  known: as of `maker`.
        Raises InputError for a scene that cannot be built, SolverError for one that cannot start.
        """
        self._scene, self._progress, self._judges = scene, progress, judges
        self._made = made = maker(scene, bundles, progress, known)
        self.engine = engine = made()
        self._start = consistent_start(engine)
        self._mended, choice = tuple(mends(engine, self._start)), engine.model.mechanism.choice
        for sentence in [*self._mended, *([choice] if choice else [])]:
            progress(None, sentence)
        repeated = engine.model.contacts and scene.output.horizon
        self._pair = Pair(engine) if repeated else None
        self._until, self._reached = np.inf, list[Followed]()
        outputs, panel = None if self._pair is None else self._pair.outputs, None if judges is None else judges.run
        other = lambda name: made(name, progress)  # noqa: E731
        self._parts = follow_in_parts(engine, self._start, progress, other, panel, self._stop, outputs)

    def until(self, time: float) -> Run:
        """Return the run up to a time [s] or later, without a perturbed run; raise SolverError when it cannot go on.

        On a request to stop it is the run so far, with the reason.
        """
        return self._observed(*self._advanced(time))

    def _advanced(self, time: float) -> Followed:
        """Return the trajectory up to a time [s] or later, or until a request to stop."""
        self._until = time
        while not self._reached or self._reached[0][0].control[m.TIME] < min(time, self._reached[0][0].end):
            with stopping.heed_requests():
                self._reached[:] = [next(self._parts)]
            if stopping.stop_reason():
                break
        return self._reached[0]

    def _stop(self, rows: np.ndarray) -> bool:
        """Return True where the steps pause; the pair is given the rows so far."""
        return (stop_requested if self._pair is None else self._pair.store_rows)(rows) or bool(
            rows[-1, 0] >= self._until
        )

    def _observed(self, last: Engine, trajectory: Trajectory, switched: str) -> Run:
        over = bool(last.control[m.TIME] >= last.end)
        engine = last if over else copy_of_engine(last)  # observation would disturb an engine that goes on
        shown = trajectory if self._pair is None else trajectory.without(self._pair.added)
        run = Run(self._scene, engine, shown, observe_run(engine, shown), None, switched, self._mended)
        if not over and stopping.stop_reason():
            return replace(run, stopped=stopping.stop_reason())
        require_shallow(run.model, run.trajectory, run.observed)
        require_closed(run.model, *run.judged)
        return run

    def whole(self) -> Run:
        """Return the run to its end, and where it has contacts its perturbed run, which steps concurrently when a
        processor is free. On a request to stop it is the run so far, with the reason."""
        pair, engine, judges = self._pair, self.engine, self._judges
        if pair is None:
            return self.until(np.inf)

        def steps(mine: Engine, y: np.ndarray, tell: Progress, stop: Stop, outputs: np.ndarray) -> Followed:
            panel = None if judges is None else judges.perturbed
            return follow(mine, y, tell, lambda name: self._made(name, tell), panel, stop, outputs)

        def begins() -> bool:
            return judges is None or bool(engine.n[m.EVALUATIONS] >= judges.trial)

        def neighbour(alive: Progress) -> PerturbedRun:
            return pair.perturbed_run(self._start, lambda mine, y, *text: steps(mine, y, alive, *text), alive, begins)

        with run_in_thread(neighbour) as perturbed:
            done = self._observed(*pair.run(lambda *text: self._advanced(np.inf)))
            if done.stopped:
                return done
            try:
                return replace(done, perturbed=perturbed())
            except StoppedError as stopped:
                return replace(done, stopped=str(stopped))


def follow(
    engine: Engine,
    y: np.ndarray,
    progress: Progress,
    other: Callable[[str], Engine],
    judges: Panel | None = None,
    stop: Stop = never,
    outputs: np.ndarray | None = None,
) -> Followed:
    """Return the trajectory to the end or until `stop`; arguments and the other results as of `follow_in_parts`."""
    with stopping.heed_requests():
        return next(follow_in_parts(engine, y, progress, other, judges, stop, outputs))


def follow_in_parts(
    engine: Engine,
    y: np.ndarray,
    progress: Progress,
    other: Callable[[str], Engine],
    judges: Panel | None = None,
    stop: Stop = never,
    outputs: np.ndarray | None = None,
) -> Iterator[Followed]:
    """Yield the engine, its trajectory from a consistent start y, and why another engine continued, if so; whenever
    `stop` asks for it, and at the end.

    other: makes the engine of another integrator, called only when needed.  judges: by integrator; an integrator to
    which a run returns has none.
    stop, outputs: as of `trajectory.in_parts`.
    """
    left, reasons, judges = None, list[str](), dict(judges or {})
    while True:
        traits = engine.method.traits
        judge, heir = judges.pop(engine.model.scene.solver.integrator, (None, traits.hands_over_to))
        try:
            for done in stepping.in_parts(engine, y, progress, stop, left, outputs, judge):
                yield engine, done, "\n".join(reasons)
            return
        except StiffError as stiff:
            progress(None, f"{stiff}; continuing with {heir}")
            reasons.append(str(stiff))
            specialised, engine, left = engine.specialised, other(heir), stiff.handover
            engine.specialised.exact = specialised.exact


def require_shallow(model: Model, trajectory: Trajectory, seen: Observed) -> None:
    """Raise SolverError for a contact deeper than its surfaces allow."""
    if not model.contacts:
        return
    from flexclear.dynamics.contact.validity import deepest, refuse_deep

    depths, _ = deepest(trajectory.events, seen.touch)
    for contact, depth in zip(model.contacts, depths, strict=True):
        refuse_deep(contact.words, contact.joint, float(depth))


def observe_run(engine: Engine, trajectory: Trajectory) -> Observed:
    """Return the observed rows of a trajectory, each with the closure rows selected at its time.

    Raises SolverError when a row could not be evaluated.
    """
    seen = _evaluate_rows(engine, trajectory)
    bad = np.flatnonzero(seen.status)
    if len(bad):
        at, lost = f"at t = {trajectory.time[bad[0]]:.6g} s: ", "the recorded state does not satisfy the loop closures"
        if seen.status[bad[0]] == m.JAMMED:
            raise SolverError(at + "friction of ideal joints jams the mechanism in the recorded state")
        if seen.status[bad[0]] == m.SINGULAR:
            lost = (
                "the recorded state is so close to a singular pose that accelerations and forces are "
                "undetermined: let the mechanism pass the pose at speed, or stop elsewhere"
            )
        raise SolverError(at + lost)
    return seen


def rows_to_judge(engine: Engine, trajectory: Trajectory, seen: Observed) -> tuple[Trajectory, Observed]:
    """Return the recorded rows with those between them, by time, and the outputs JUDGED there.

    seen: outputs of the recorded rows, of which the others are returned as they are.  Energies, speeds and deformations
    are judged by all these rows: recorded ones may meet a motion where it is always the same.
    """
    inner = replace(trajectory, rows=trajectory.between)
    if not len(inner.rows):
        return trajectory, seen
    there = _evaluate_rows(engine, inner)
    fine = np.flatnonzero(there.status == m.OK)  # without those next to a singular pose
    rows = np.concatenate([trajectory.rows, inner.rows[fine]])
    order = np.argsort(rows[:, 0], kind="stable")
    both = {name: np.concatenate([getattr(seen, name), getattr(there, name)[fine]])[order] for name in JUDGED}
    return replace(trajectory, rows=rows[order]), replace(seen, **both)


def _evaluate_rows(engine: Engine, trajectory: Trajectory) -> Observed:
    """Return the rows of a trajectory as `observe_run` does, those that could not be evaluated as well."""
    parts = list[Blocks]()
    for part, selected in trajectory.parts():
        engine.keep(selected)
        out = observe_blocks(engine, trajectory.rows[part])
        for k, motion in _near_singular(engine, trajectory.rows[part], trajectory.collocations):
            limit = _limit(engine, trajectory.rows[part][k], motion, bool(out["status"][k, 0]))
            for name, values in limit.items():
                out[name][k] = values
        parts.append(out)
    # megabytes are copied only when there is something to join: copying takes as long as a short run
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]} if parts[1:] else parts[0]
    return observation.by_name(joined, engine.model.arrays.size)


def _limit(engine: Engine, row: np.ndarray, motion: Collocation, lost: bool) -> dict[str, np.ndarray]:
    """Return the outputs around a row next to a singular pose; nothing when the row itself is as accurate."""
    limit = collocation.observe_around(engine, row, motion, collocation.CLEAR)
    if limit is None and lost:
        limit = collocation.observe_around(engine, row, motion, collocation.NEARLY_CLEAR)
    return limit or {}


def _near_singular(
    engine: Engine, rows: np.ndarray, motions: tuple[Collocation, ...]
) -> Iterator[tuple[int, Collocation]]:
    """Return the indices of rows too close to a singular pose, and the motion over it to which they belong."""
    for motion in motions:
        engine.select_pieces_after(0.5 * (motion.start + motion.end))
        begin = np.searchsorted(rows[:, 0], motion.start, side="left" if motion.start == engine.start else "right")
        for k in range(int(begin), int(np.searchsorted(rows[:, 0], motion.end, side="right"))):
            if collocation.is_blurred(engine, rows[k]):
                yield k, motion
