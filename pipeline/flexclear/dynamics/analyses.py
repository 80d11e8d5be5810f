"""Other results of a scene and its bundles: costs, ensembles, sections, equilibria and vibrations.

The keys of single runs do not depend on this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.artifacts.labelled import Labelled
    from flexclear.dynamics.record.cost import Cost
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress


def cost(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress, *, checked: bool = True) -> Cost:
    """Run a scene once and measure the costs of integration and recording (`dynamics.record.cost.measure`)."""
    from flexclear.dynamics.record.cost import measure

    require_without_events(scene, "the cost of a run")
    return measure(scene, bundles, progress, checked=checked)


def ensemble(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Run all members of a scene's ensemble; return their values at its regular output times (schema ENSEMBLE)."""
    from flexclear.dynamics.record.ensemble import ensemble as run

    require_without_events(scene, "an ensemble")
    return run(scene, bundles, progress)


def sections(scene: Scene, bundles: Mapping[str, Labelled], progress: Progress) -> xr.Dataset:
    """Sample a scene with periodic laws once in each period (schema SECTIONS)."""
    from flexclear.dynamics.record.sections import sections as run

    require_without_events(scene, "a section of the motion")
    return run(scene, bundles, progress)


def require_without_events(scene: Scene, what: str) -> None:
    """Raise InputError for a scene with events, for which this result is not available."""
    from flexclear.system.errors import InputError

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
    """Return the static equilibrium close to the scene's start pose, with drives held (schema EQUILIBRIUM).

    time: at which the drives' laws are evaluated [s]; the start when None.  drives: positions [m or rad] by
    name instead.  moving: True when the drives keep their speed at that time; the pose is then one of steady motion.
    Raises InputError for a scene that cannot be built, SolverError when no equilibrium is found.
    """
    from flexclear.dynamics.linear import dataset
    from flexclear.dynamics.linear.equilibrium import balanced

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
    """Return natural vibrations about `equilibrium`, which has the same arguments (schema LINEAR)."""
    from flexclear.dynamics.linear import dataset
    from flexclear.dynamics.linear.equilibrium import balanced
    from flexclear.dynamics.linear.vibrations import vibrations

    bench, rest, small = balanced(scene, bundles, progress, time, drives, moving)
    return dataset.linear(bench, rest, small or vibrations(bench, rest.at), moving)
