"""Stage 5: a run (and its ensemble) -> the series and tables derived from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.pipeline.core.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The post dataset (schema POST)."""
    from flexclear.pipeline.post import derive

    return {"nc": derive(inputs["run"], inputs.get("ensemble"))}
