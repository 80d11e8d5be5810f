"""Next to stage 4: scene, bundles and run -> derivatives of quantities by numbers of the scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from flexclear.pipeline.core.workflow import stopping
from flexclear.stages import simulation

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The derivatives; inputs are ``bundle/<body>``, and ``run`` of a scene with contacts, which has the horizon."""
    from flexclear.pipeline import dynamics

    scene = simulation.rebuild(params, inputs)
    horizon = float(inputs["run"]["horizon"]) if "run" in inputs else np.inf
    with stopping.until(scene.limits.time, scene.limits.time_words):
        bundles, names = simulation.bundles(inputs), (params["of"], params["to"])
        return {"nc": dynamics.sensitivities(scene, bundles, progress, *names, horizon)}
