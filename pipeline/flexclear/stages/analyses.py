"""Analyses next to stage 4: scene and bundles -> ensemble, sections, derivatives, linear vibrations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.artifacts.paths import results_root
from flexclear.dynamics import analyses
from flexclear.scene.quantity import Quantity
from flexclear.stages.simulation import bundles, check_run, in_time, rebuild

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.system.progress import Progress


def ensemble(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Run all members of the scene's ensemble (schema ENSEMBLE); inputs are ``bundle/<body>``."""
    scene = rebuild(params, inputs)
    check_run(scene, results_root())
    with in_time(scene):
        return {"nc": analyses.ensemble(scene, bundles(inputs), progress)}


def sections(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Sample a periodic motion once per period (schema SECTIONS); inputs are ``bundle/<body>``."""
    scene = rebuild(params, inputs)
    with in_time(scene):
        return {"nc": analyses.sections(scene, bundles(inputs), progress)}


def sensitivities(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Differentiate the quantities `of` with respect to the numbers `to` of the scene.

    inputs: ``bundle/<body>``; for a scene with contacts also ``run``, which contains the predictability horizon; for
    numbers of `recipes` the bundles ``varied/<step>/<path>`` at -2, -1, 1 and 2 steps.
    """
    from flexclear.dynamics.sensitivity.dataset import sensitivities as derivatives
    from flexclear.dynamics.sensitivity.recipes import vary_number

    scene = rebuild(params, inputs)
    analyses.require_without_events(scene, "derivatives")
    horizon = float(inputs["run"]["horizon"]) if "run" in inputs else math.inf
    reduced, numbers = bundles(inputs), {}
    for path, (body, *number) in params.get("recipes", {}).items():
        around = {k: inputs[f"varied/{k}/{path}"] for k in (-2, -1, 1, 2)}
        numbers[path] = vary_number(path, body, (number[0], number[1]), reduced[body], around)
    with in_time(scene):
        names = params["of"], params["to"]
        return {"nc": derivatives(scene, reduced, progress, *names, horizon, numbers)}


def linear(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Find the equilibrium in a `pose` (schema EQUILIBRIUM), with natural vibrations if requested (schema LINEAR); with
    `speeds` of a drive, compute only vibrations at these speeds (schema CAMPBELL). Inputs are ``bundle/<body>``."""
    from flexclear.dynamics.linear.campbell import campbell

    pose, scene, reduced = params["pose"], rebuild(params, inputs), bundles(inputs)
    where = pose["time"], pose["drives"]
    if "speeds" in params:
        return {"nc": campbell(scene, reduced, progress, params["speeds"], params["drive"], *where)}
    solve = analyses.frequencies if pose["vibrations"] else analyses.equilibrium
    return {"nc": solve(scene, reduced, progress, *where, pose["moving"])}


def state_space(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Return the state space about the equilibrium in a `pose` (schema STATE_SPACE); inputs are ``bundle/<body>``."""
    pose, scene = params["pose"], rebuild(params, inputs)
    outputs = [Quantity.from_json(data) for data in params["outputs"]]
    where = pose["time"], pose["drives"], pose["held"]
    return {"nc": analyses.state_space(scene, bundles(inputs), progress, outputs, *where)}
