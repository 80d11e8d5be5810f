"""One run from scene to observed rows; where an explicit method would crawl, an implicit one takes over."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np

from flexclear.pipeline.core.errors import SolverError, StoppedError
from flexclear.pipeline.core.progress import Progress
from flexclear.pipeline.core.registry import lookup, module_of
from flexclear.pipeline.core.scene.drives import PathDrive
from flexclear.pipeline.core.scene.load import edited
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.drives.pieces import Pieces
from flexclear.pipeline.dynamics.effects import STARTS
from flexclear.pipeline.dynamics.equations import observation
from flexclear.pipeline.dynamics.equations.observation import Observed
from flexclear.pipeline.dynamics.model.mechanism import build
from flexclear.pipeline.dynamics.model.model import Model, tabulate
from flexclear.pipeline.dynamics.run import trajectory as stepping
from flexclear.pipeline.dynamics.run.collocation import Collocation
from flexclear.pipeline.dynamics.run.engine import Engine, prepare
from flexclear.pipeline.dynamics.run.ledger import require_closed
from flexclear.pipeline.dynamics.run.observation import CLEAR, NEARLY_CLEAR, beside, blurred, observe_flat
from flexclear.pipeline.dynamics.run.pace import Judge
from flexclear.pipeline.dynamics.run.start import consistent_start, mends
from flexclear.pipeline.dynamics.run.trajectory import StiffError, Trajectory

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.dynamics.run.sensitivity import Twin


@dataclass(frozen=True)
class Run:
    """A finished integration.

    scene: as the user gave it; the engine may hold another, made for it.
    twin: the run's twin, of scenes with contacts.
    mended: what was changed of the start that the scene gives, in words.
    switched: from when on and why another integrator took the place of the first; empty when none did.
    """

    scene: Scene
    engine: Engine
    trajectory: Trajectory
    observed: Observed
    twin: Twin | None = None
    switched: str = ""
    mended: tuple[str, ...] = ()

    @property
    def model(self) -> Model:
        """What was run."""
        return self.engine.model


def engine_of(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Engine:
    """The compiled engine of a scene where its run begins; paths are not looked for."""
    return prepare(tabulate(build(begun(scene, bundles, progress)[0], bundles)), progress)


def placed(scene: Scene) -> Scene:
    """The scene whose joints and drives place the bodies where the run begins: itself, unless it begins elsewhere."""
    if scene.start is None or scene.start.at is None:
        return scene
    found: Scene = import_module(module_of(STARTS, scene.start.at, where="[start.at]")).placed(scene)
    return found


def driven(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> tuple[Scene, Mapping[str, Pieces]]:
    """The scene with actuators driven as the paths that they shall produce demand, and the laws of their motion."""
    if not any(isinstance(drive, PathDrive) and drive.actuators for drive in scene.drive.values()):
        return scene, {}
    from flexclear.pipeline.dynamics.run.inverse import actuated

    return actuated(scene, bundles, progress)


def begun(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> tuple[Scene, str]:
    """The scene with the poses and velocities of where it says that the run begins, instead of its own.

    With it which of several ways it was assembled in, in words; empty where there is one, or the scene chooses.
    """
    if scene.start is None or scene.start.at is None:
        return scene, ""
    begin = lookup(STARTS, scene.start.at, where="[start.at]")
    found: tuple[Scene, str] = begin(scene, bundles, progress)
    return found


def engines(
    scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress
) -> tuple[Engine, Callable[[str], Engine]]:
    """The engine of a run, and the maker of one that goes on with another integrator, given by its name."""
    made = _maker(scene, bundles, progress)
    return made(""), cache(made)


def _maker(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> Callable[[str], Engine]:
    """What makes the engine of a run by an integrator's name; that of the scene's own by none."""
    posed, choice = begun(scene, bundles, progress)
    moved, given = driven(posed, bundles, progress)

    def made(name: str) -> Engine:
        wanted = edited(moved, {"solver.integrator": name}) if name else moved
        model = tabulate(build(wanted, bundles), given)
        if choice:  # the poses found no longer tell of it
            model = replace(model, mechanism=replace(model.mechanism, choice=choice))
        return prepare(model, progress)

    return made


def integrate(
    scene: Scene,
    bundles: Mapping[str, xr.Dataset],
    progress: Progress,
    judges: Mapping[str, tuple[Judge, str]] | None = None,
) -> Run:
    """Build, start, integrate and observe a scene; actuators that shall produce a path are driven as it demands.

    bundles: reduced flexible bodies by name.  judges: by integrator, who looks whether another one shall go on, and
    which; without them the explicit ones hand over where they would crawl.  Raises InputError for a scene that cannot
    be built, SolverError when the run cannot go on, StoppedError with the run so far as `partial` when it is asked to
    stop.
    """
    made = _maker(scene, bundles, progress)
    engine = made("")
    start = consistent_start(engine)
    mended, choice = tuple(mends(engine, start)), engine.model.mechanism.choice
    for sentence in [*mended, *([choice] if choice else [])]:
        progress(None, sentence)
    try:
        engine, trajectory, switched = follow(engine, start, progress, made, judges)
    except StoppedError as stopped:
        if stopped.partial is not None:
            last, there = stopped.partial
            stopped.partial = Run(scene, last, there, observed(last, there), mended=mended)
        raise
    seen = observed(engine, trajectory)
    require_shallow(engine.model, trajectory, seen)
    require_closed(engine.model, trajectory, seen)
    done = Run(scene, engine, trajectory, seen, None, switched, mended)
    try:
        return replace(done, twin=twin_of(engine, start, trajectory))
    except StoppedError as stopped:
        stopped.partial = done
        raise


def follow(
    engine: Engine,
    y: np.ndarray,
    progress: Progress,
    other: Callable[[str], Engine],
    judges: Mapping[str, tuple[Judge, str]] | None = None,
) -> tuple[Engine, Trajectory, str]:
    """The trajectory from a consistent start y, the engine that came to its end, and why it is another; else nothing.

    other: gives the engine that takes over by its integrator, asked only when it is needed.  judges: see `integrate`.
    """
    left, reasons = None, list[str]()
    while True:
        traits = engine.method.traits
        judge, heir = (judges or {}).get(engine.model.scene.solver.integrator, (None, traits.hands_over_to))
        try:
            return engine, stepping.integrate(engine, y, progress, left=left, judge=judge), "\n".join(reasons)
        except StiffError as stiff:
            progress(None, f"{stiff}; going on with {heir}")
            reasons.append(str(stiff))
            straight, engine, left = engine.straight, other(heir), stiff.handover
            engine.straight.wanted, engine.straight.exact = straight.wanted, straight.exact


def require_shallow(model: Model, trajectory: Trajectory, seen: Observed) -> None:
    """SolverError for a contact so deep that its surfaces mean nothing."""
    if not model.contacts:
        return
    from flexclear.pipeline.dynamics.contact.validity import deepest, refuse_deep

    depths, _ = deepest(trajectory.events, seen.touch)
    for contact, depth in zip(model.contacts, depths, strict=True):
        refuse_deep(contact.words, contact.joint, float(depth))


def twin_of(engine: Engine, start: np.ndarray, trajectory: Trajectory) -> Twin | None:
    """The twin of a run with contacts."""
    if not engine.model.contacts:
        return None
    from flexclear.pipeline.dynamics.run.sensitivity import twin

    return twin(engine, start, trajectory)


def observed(engine: Engine, trajectory: Trajectory) -> Observed:
    """The observed rows of a trajectory, each with the closure rows that were solved for when it was made.

    Raises SolverError where one of them could not be evaluated.
    """
    parts = []
    for part, kept in trajectory.parts():
        engine.keep(kept)
        out = observe_flat(engine, trajectory.rows[part])
        for k, motion in _near_singular(engine, trajectory.rows[part], trajectory.collocations):
            row, lost = trajectory.rows[part][k], observation.by_name(out, engine.model.arrays.size).status[k]
            limit = beside(engine, row, motion, CLEAR)
            if limit is None and lost:
                limit = beside(engine, row, motion, NEARLY_CLEAR)
            if limit is not None:
                out[k] = limit
        parts.append(out)
    # a megabyte is copied only where there is something to join: that would take as long as a short run
    seen = observation.by_name(parts[0] if len(parts) == 1 else np.concatenate(parts), engine.model.arrays.size)
    bad = np.flatnonzero(seen.status)
    if len(bad):
        at, lost = f"at t = {trajectory.time[bad[0]]:.6g} s: ", "the recorded state does not satisfy the loop closures"
        if seen.status[bad[0]] == m.JAMMED:
            raise SolverError(at + "friction of ideal joints jams the mechanism in the recorded state")
        if seen.status[bad[0]] == m.SINGULAR:
            lost = (
                "the recorded state is so near to a singular pose that nothing tells its accelerations and forces: let "
                "the mechanism pass the pose at speed, or stop elsewhere"
            )
        raise SolverError(at + lost)
    return seen


def _near_singular(
    engine: Engine, rows: np.ndarray, motions: tuple[Collocation, ...]
) -> Iterator[tuple[int, Collocation]]:
    """Rows, by number, that are too near to a singular pose, and the motion over it to which they belong."""
    for motion in motions:
        engine.select_pieces_after(0.5 * (motion.start + motion.end))
        begin = np.searchsorted(rows[:, 0], motion.start, side="left" if motion.start == engine.start else "right")
        for k in range(int(begin), int(np.searchsorted(rows[:, 0], motion.end, side="right"))):
            if blurred(engine, rows[k]):
                yield k, motion
