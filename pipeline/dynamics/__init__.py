"""The multibody tower: a scene and its bundles in, a run dataset out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import Labelled, LabelledArrays
    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress
    from flexclear.pipeline.dynamics.record.cost import Cost
    from flexclear.pipeline.dynamics.run.method_choice.method_selection import Suit
    from flexclear.pipeline.dynamics.run.progress_rate import Judges

__all__ = [
    "cost",
    "ensemble",
    "equilibrium",
    "frequencies",
    "sections",
    "simulate",
    "simulated",
]


def simulate(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """What `simulated` gives, as a dataset; so is what there is of a run that is asked to stop."""
    from flexclear.pipeline.core.system.errors import StoppedError

    try:
        return simulated(scene, bundles, progress).to_xarray()
    except StoppedError as stopped:
        if stopped.partial is not None:
            stopped.partial = stopped.partial.to_xarray()
        raise


def simulated(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> LabelledArrays:
    """One run of a scene (schema RUN).

    bundles: reduced flexible bodies by name.  progress(fraction or None, text) is called now and then.
    A scene with `[accuracy]` is run until the estimated error of its time integration is what was asked for; where it
    names no integrator, by the cheapest.  One that has neither `[accuracy]` nor a method or tolerance in `[solver]` is
    run at the default tolerance, or, where that is dear, as `accuracy.by_default` says.
    Raises InputError for a scene that cannot be built, SolverError when the run cannot continue, StoppedError with what
    there is of it, marked as incomplete, when it is asked to stop.
    """
    from flexclear.pipeline.core.artifacts.labelled import of
    from flexclear.pipeline.core.artifacts.schema import incomplete
    from flexclear.pipeline.core.system.errors import StoppedError
    from flexclear.pipeline.dynamics.record.dataset import recorded, warnings
    from flexclear.pipeline.dynamics.run.progress_rate import DearError, affordable
    from flexclear.pipeline.dynamics.run.run import Run, integrate

    def once(edited: Scene, judges: Judges | None = None) -> LabelledArrays:
        if edited.event:
            from flexclear.pipeline.core.scene.registry import lookup
            from flexclear.pipeline.dynamics.effects import EVENTS

            phased: LabelledArrays = lookup(EVENTS, "phases", where="[event]")(edited, bundles, progress, judges)
            return phased
        try:
            done = integrate(edited, bundles, progress, judges)
        except StoppedError as stopped:
            there = stopped.partial
            # another one's motion, such as where the run begins, is nothing of this run
            stopped.partial = incomplete(recorded(there), str(stopped)) if isinstance(there, Run) else None
            raise
        for sentence in warnings(done):
            progress(None, f"warning: {sentence}")
        return recorded(done)

    requested = scene.accuracy is not None and scene.accuracy.quantities
    if not requested:
        try:
            return once(scene, affordable(scene))
        except DearError as dear:
            progress(None, str(dear))
    from flexclear.pipeline.dynamics.run.method_choice.accuracy import by_default, deliver

    def compared(edited: Scene, judges: Judges | None = None) -> xr.Dataset:
        return once(edited, judges).to_xarray()

    if not scene.by_need():
        return of(deliver(scene, compared, progress))

    def suited(edited: Scene) -> Suit:
        from flexclear.pipeline.dynamics.run.method_choice.method_selection import suit

        return suit(edited, bundles)

    if requested:
        return of(deliver(scene, compared, progress, suited(scene)))
    return of(by_default(scene, compared, progress, suited))


def cost(
    scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, *, checked: bool = True, brief: bool = False
) -> Cost:
    """One run, and what its integration and its recording cost each (`pipeline.dynamics.record.cost.measure`)."""
    from flexclear.pipeline.dynamics.record.cost import measure

    require_without_events(scene, "the cost of a run")
    return measure(scene, bundles, progress, checked=checked, brief=brief)


def ensemble(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """All members of a scene's ensemble on its regular output times (schema ENSEMBLE)."""
    from flexclear.pipeline.dynamics.record.ensemble import ensemble as run

    require_without_events(scene, "an ensemble")
    return run(scene, bundles, progress)


def sections(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """A scene whose laws repeat, sampled once in each period (schema SECTIONS)."""
    from flexclear.pipeline.dynamics.record.sections import sections as run

    require_without_events(scene, "a section of the motion")
    return run(scene, bundles, progress)


def require_without_events(scene: Scene, what: str) -> None:
    """InputError for a scene with events, of which there is no such result."""
    from flexclear.pipeline.core.system.errors import InputError

    if scene.event:
        name = next(iter(scene.event))
        raise InputError(f"[event.{name}]", f"{what} needs a scene without events", 'remove them: remove = ["event"]')


def equilibrium(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    moving: bool = False,
) -> xr.Dataset:
    """Static equilibrium close to the scene's start pose, its drives held (schema EQUILIBRIUM).

    time: at which the drives' laws give their positions [s]; the start when None.  drives: positions [m or rad] by
    name instead.  moving: the drives keep the speed of that moment, and the pose is one of steady motion.
    Raises InputError for a scene that cannot be built, SolverError when there is no equilibrium.
    """
    from flexclear.pipeline.dynamics.linear import dataset
    from flexclear.pipeline.dynamics.linear.equilibrium import balanced

    bench, rest, _ = balanced(scene, bundles, progress, time, drives, moving)
    return dataset.equilibrium(bench, rest, moving)


def frequencies(
    scene: Scene,
    bundles: Mapping[str, Labelled],
    progress: Progress,
    time: float | None = None,
    drives: Mapping[str, float] | None = None,
    moving: bool = False,
) -> xr.Dataset:
    """Natural vibrations of the assembled mechanism about `equilibrium` (schema LINEAR); arguments as there."""
    from flexclear.pipeline.dynamics.linear import dataset
    from flexclear.pipeline.dynamics.linear.equilibrium import balanced
    from flexclear.pipeline.dynamics.linear.vibrations import vibrations

    bench, rest, small = balanced(scene, bundles, progress, time, drives, moving)
    return dataset.linear(bench, rest, small or vibrations(bench, rest.at), moving)
