"""Next to stage 3: mesh -> mass, inertia and frames of the body taken as rigid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from flexclear.system.progress import Progress


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """Compute the rigid body (schema RIGID)."""
    from flexclear.structure.modes import bundle

    progress(None, "mass and inertia")
    return {"nc": bundle.rigid(inputs["mesh"])}
