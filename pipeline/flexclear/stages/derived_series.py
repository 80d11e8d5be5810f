"""Stage 5: a run (and its ensemble) -> derived series and tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexclear.scene.provenance import assumed_values
from flexclear.stages import meshing
from flexclear.workflow.task import given_arrays

if TYPE_CHECKING:
    from flexclear.artifacts.labelled import LabelledArrays
    from flexclear.scene.schema import Scene
    from flexclear.system.progress import Progress


@given_arrays
def run(params: Mapping[str, Any], inputs: Mapping[str, LabelledArrays], progress: Progress) -> dict[str, Any]:
    """Derive the post dataset (schema POST); its attributes hold the provenance of the scene's values."""
    from flexclear.post.single_run.series import derive_arrays

    return {"nc": derive_arrays(inputs["run"], inputs.get("ensemble")).assign_attrs(**params["attributes"])}


def params(scene: Scene) -> dict[str, Any]:
    """Return the attributes that no run depends on: `sources` and `assumptions`, key path -> text, as JSON."""
    return {"attributes": origins(scene)}


def origins(scene: Scene) -> dict[str, str]:
    """Return the provenance of the scene's values as attributes of datasets."""
    texts = sources(scene)
    origin = {"sources": texts, "assumptions": assumed_values(texts)}
    return {name: json.dumps(by_place, sort_keys=True) for name, by_place in origin.items()}


def sources(scene: Scene) -> dict[str, str]:
    """Return the provenance of the scene's values, including those of mesh recipes: key path -> text."""
    by_path = scene.sources()
    for body, recipe in scene.recipes().items():
        by_path |= meshing.sources(Path(recipe), f"body.{body}.recipe")
    return by_path
