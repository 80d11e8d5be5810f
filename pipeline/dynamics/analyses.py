"""What else the tower makes of a scene and its bundles: costs, ensembles, sections, equilibria and vibrations.

None of it is in the keys of single runs, which do not reach this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.artifacts.labelled import Labelled
    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress
    from flexclear.pipeline.dynamics.record.cost import Cost


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
