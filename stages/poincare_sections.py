"""Next to stage 4: scene and bundles -> sections of its periodic motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.workflow import stopping
from flexclear.stages import simulation

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.scene.schema import Scene
    from flexclear.pipeline.core.system.progress import Progress

#: what sections do not depend on
LEFT_OUT = ("output", "ensemble", "accuracy")


def params(scene: Scene) -> dict[str, Any]:
    """The scene as the engine sees it."""
    common = simulation.params(scene, sections=True)
    return {**common, "scene": {name: part for name, part in common["scene"].items() if name not in LEFT_OUT}}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Sections (schema SECTIONS); inputs are ``bundle/<body>``."""
    from flexclear.pipeline import dynamics

    scene = simulation.rebuild(params, inputs)
    with stopping.until(scene.limits.time, scene.limits.time_words):
        return {"nc": dynamics.sections(scene, simulation.bundles(inputs), progress)}
