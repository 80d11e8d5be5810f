"""Next to stage 4: scene and bundles -> equilibrium in one pose and the natural vibrations about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from flexclear.stages import simulation

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress

#: what the vibrations do not depend on
LEFT_OUT = ("output", "ensemble")


def params(
    scene: Scene, time: float | None, drives: Mapping[str, float] | None, *, moving: bool, vibrations: bool
) -> dict[str, Any]:
    """The scene as the engine sees it, and where it is examined."""
    common = simulation.params(scene)
    table = {name: part for name, part in common["scene"].items() if name not in LEFT_OUT}
    pose = {"time": time, "drives": dict(drives or {}), "moving": moving, "vibrations": vibrations}
    return {**common, "scene": table, "pose": pose}


def campbell_params(
    scene: Scene,
    speeds: Sequence[float],
    drive: str | None,
    time: float | None,
    drives: Mapping[str, float] | None,
) -> dict[str, Any]:
    """The scene as the engine sees it, and the speeds of a drive."""
    common = params(scene, time, drives, moving=True, vibrations=True)
    return {**common, "speeds": [float(speed) for speed in speeds], "drive": drive}


def campbell(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The vibrations over the speed of a drive (schema CAMPBELL); inputs are ``bundle/<body>``."""
    from flexclear.pipeline import dynamics

    pose, scene, bundles = params["pose"], simulation.rebuild(params, inputs), simulation.bundles(inputs)
    where = params["speeds"], params["drive"], pose["time"], pose["drives"]
    return {"nc": dynamics.campbell(scene, bundles, progress, *where)}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The equilibrium (schema EQUILIBRIUM), or with its vibrations (schema LINEAR); inputs are ``bundle/<body>``."""
    from flexclear.pipeline import dynamics

    pose = params["pose"]
    solve = dynamics.frequencies if pose["vibrations"] else dynamics.equilibrium
    scene, bundles = simulation.rebuild(params, inputs), simulation.bundles(inputs)
    return {"nc": solve(scene, bundles, progress, pose["time"], pose["drives"], pose["moving"])}
