"""The multibody tower: a scene and its bundles in, a run dataset out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.scene.schema import Scene

Progress = Callable[[float | None, str], None]

__all__ = ["ensemble", "simulate"]


def simulate(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> xr.Dataset:
    """One run of a scene (schema RUN).

    bundles: reduced flexible bodies by name.  progress(share or None, text) is called now and then.
    A scene with `[accuracy]` is run until the error of its time integration, estimated, is what was asked for.
    Raises InputError for a scene that cannot be built, SolverError when the run cannot go on.
    """
    from pipeline.dynamics.record.dataset import dataset
    from pipeline.dynamics.run import integrate

    def once(edited: Scene) -> xr.Dataset:
        return dataset(integrate(edited, bundles, progress))

    if scene.accuracy is None or not scene.accuracy.quantities:
        return once(scene)
    from pipeline.dynamics.accuracy import deliver

    return deliver(scene, once, progress)


def ensemble(scene: Scene, bundles: Mapping[str, xr.Dataset], progress: Progress) -> xr.Dataset:
    """All members of a scene's ensemble on its regular output times (schema ENSEMBLE)."""
    from pipeline.dynamics.record.ensemble import ensemble as run

    return run(scene, bundles, progress)
