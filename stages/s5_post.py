"""Stage 5: a run (and its ensemble) -> the series and tables derived from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flexclear.pipeline.core.workflow.task import given_arrays

if TYPE_CHECKING:
    from flexclear.pipeline.core.artifacts.labelled import LabelledArrays
    from flexclear.pipeline.core.progress import Progress


@given_arrays
def run(params: Mapping[str, Any], inputs: Mapping[str, LabelledArrays], progress: Progress) -> dict[str, Any]:
    """The post dataset (schema POST)."""
    from flexclear.pipeline.post import derived

    return {"nc": derived(inputs["run"], inputs.get("ensemble"))}
