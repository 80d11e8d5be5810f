"""The multibody tower: computes a run dataset from a scene and its bundles; `analyses` has other results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled, LabelledArrays
    from flexclear.dynamics.run.evaluation.engine import Engine
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
    from flexclear.artifacts.labelled import label_dataset
    from flexclear.dynamics.run.progress_rate import DearError, affordable
    from flexclear.dynamics.single_run import SingleRun

    known: list[Engine | None] = []

    def begun(edited: Scene, judges: Judges | None = None) -> SingleRun:
        run = SingleRun(edited, bundles, progress, judges, known[0] if known else None)
        known[:] = known or [run.engine]
        return run

    requested = scene.accuracy is not None and scene.accuracy.quantities
    if not requested:
        try:
            return begun(scene, affordable(scene)).whole()
        except DearError as dear:
            progress(None, str(dear))
    from flexclear.dynamics.run.method_choice import accuracy

    if not scene.by_need():
        return label_dataset(accuracy.deliver(scene, begun, progress))
    from flexclear.dynamics.run.method_choice.method_selection import method_costs

    if requested:
        return label_dataset(accuracy.deliver(scene, begun, progress, method_costs(scene, bundles)))
    if scene.solver.by_need == "integrator":
        return label_dataset(accuracy.at_tolerance(scene, begun, method_costs(scene, bundles)))
    return label_dataset(accuracy.by_default(scene, begun, progress, lambda edited: method_costs(edited, bundles)))
