"""The multibody tower: computes a run dataset from a scene and its bundles; `analyses` has other results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled, LabelledArrays
    from flexclear.dynamics.run.progress_rate import Judges
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress


def simulate(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Return the dataset of `simulated`."""
    return simulated(scene, bundles, progress).to_xarray()


def simulated(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> LabelledArrays:
    """Run a scene once and return its dataset (schema RUN).

    bundles: reduced flexible bodies by name.  progress(fraction or None, text) is called regularly.
    A scene with `[accuracy]` is run until the estimated error of its time integration is below the request; where it
    names no integrator, the cheapest is chosen.  With neither `[accuracy]` nor method in `[solver]` it is run by the
    default one, or, where that is expensive, by `accuracy.at_tolerance` or, without a tolerance, `accuracy.by_default`.
    Raises InputError for a scene that cannot be built, SolverError when the run cannot continue, StoppedError, with the
    partial run marked as incomplete, when it is stopped.
    """
    from flexclear.artifacts.labelled import of
    from flexclear.artifacts.schema import incomplete
    from flexclear.dynamics.record.dataset import recorded, warnings
    from flexclear.dynamics.run.progress_rate import DearError, affordable
    from flexclear.dynamics.run.run import integrate_until_stopped
    from flexclear.workflow import stopping

    def once(edited: Scene, judges: Judges | None = None, *, alone: bool = False) -> LabelledArrays:
        if edited.event:
            from flexclear.dynamics.events import phases

            return phases.simulated(edited, bundles, progress, judges)
        done = integrate_until_stopped(edited, bundles, progress, judges, alone=alone)
        if done.stopped:
            raise stopping.error(done.stopped, incomplete(recorded(done), done.stopped))
        for sentence in warnings(done):
            progress(None, f"warning: {sentence}")
        return recorded(done)

    requested = scene.accuracy is not None and scene.accuracy.quantities
    if not requested:
        try:
            return once(scene, affordable(scene))
        except DearError as dear:
            progress(None, str(dear))
    from flexclear.dynamics.run.method_choice import accuracy

    def compared(edited: Scene, judges: Judges | None = None, *, alone: bool = False) -> xr.Dataset:
        return once(edited, judges, alone=alone).to_xarray()

    if not scene.by_need():
        return of(accuracy.deliver(scene, compared, progress))
    from flexclear.dynamics.run.method_choice.method_selection import method_costs

    if requested:
        return of(accuracy.deliver(scene, compared, progress, method_costs(scene, bundles)))
    if scene.solver.by_need == "integrator":
        return of(accuracy.at_tolerance(scene, compared, method_costs(scene, bundles)))
    return of(accuracy.by_default(scene, compared, progress, lambda edited: method_costs(edited, bundles)))
