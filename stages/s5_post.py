"""Stage 5: a run (and its ensemble) -> the series and tables derived from it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.scene.origins import assumed
from flexclear.pipeline.core.workflow.task import given_arrays
from flexclear.stages import s1_mesh

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays
    from flexclear.pipeline.core.progress import Progress
    from flexclear.pipeline.core.scene.schema import Scene


@given_arrays
def run(params: Mapping[str, Any], inputs: Mapping[str, LabelledArrays], progress: Progress) -> dict[str, Any]:
    """The post dataset (schema POST), with what the scene says of where its values come from."""
    from flexclear.pipeline.post import derived

    return {"nc": derived(inputs["run"], inputs.get("ensemble")).assign_attrs(**params["told"])}


def params(scene: Scene) -> dict[str, Any]:
    """Attributes that no run depends on: `sources` and `assumptions`, place in the scene -> text, as JSON."""
    return {"told": origins(scene)}


def origins(scene: Scene) -> dict[str, str]:
    """Where values come from, those of mesh recipes included, as attributes of datasets."""
    sources = scene.sources()
    for body, recipe in scene.recipes().items():
        sources |= s1_mesh.sources(Path(recipe), f"body.{body}.mesh")
    found = {"sources": sources, "assumptions": assumed(sources)}
    return {name: json.dumps(texts, sort_keys=True) for name, texts in found.items()}
