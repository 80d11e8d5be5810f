"""Stage 3: mesh and modes -> the reduced modal bundle, all that the dynamics needs of the body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.workflow.execute import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The bundle (schema BUNDLE)."""
    from pipeline.structure.modes import bundle

    return {"nc": bundle.build(inputs["mesh"], inputs["modes"])}
