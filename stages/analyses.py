"""Next to stage 4: scene and bundles -> an ensemble, sections, derivatives, vibrations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.artifacts.paths import results_root
from flexclear.pipeline.dynamics import analyses
from flexclear.stages.simulation import bundles, check_run, in_time, rebuild

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress


def ensemble(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """All members (schema ENSEMBLE); inputs are ``bundle/<body>``."""
    scene = rebuild(params, inputs)
    check_run(scene, results_root())
    with in_time(scene):
        return {"nc": analyses.ensemble(scene, bundles(inputs), progress)}


def sections(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Sections of a periodic motion (schema SECTIONS); inputs are ``bundle/<body>``."""
    scene = rebuild(params, inputs)
    with in_time(scene):
        return {"nc": analyses.sections(scene, bundles(inputs), progress)}


def sensitivities(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Derivatives of quantities `of` by numbers of the scene, `to`.

    inputs: ``bundle/<body>``, and ``run`` of a scene with contacts, which has the horizon.
    """
    from flexclear.pipeline.dynamics.sensitivity.dataset import sensitivities as derivatives

    scene = rebuild(params, inputs)
    analyses.require_without_events(scene, "derivatives")
    horizon = float(inputs["run"]["horizon"]) if "run" in inputs else math.inf
    with in_time(scene):
        names = params["of"], params["to"]
        return {"nc": derivatives(scene, bundles(inputs), progress, *names, horizon)}


def linear(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The equilibrium in a `pose` (schema EQUILIBRIUM), or with its vibrations (schema LINEAR); over the speeds of a
    drive these alone (schema CAMPBELL).  Inputs are ``bundle/<body>``."""
    from flexclear.pipeline.dynamics.linear.campbell import campbell

    pose, scene, reduced = params["pose"], rebuild(params, inputs), bundles(inputs)
    where = pose["time"], pose["drives"]
    if "speeds" in params:
        return {"nc": campbell(scene, reduced, progress, params["speeds"], params["drive"], *where)}
    solve = analyses.frequencies if pose["vibrations"] else analyses.equilibrium
    return {"nc": solve(scene, reduced, progress, *where, pose["moving"])}
