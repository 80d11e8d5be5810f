"""Stage 1: recipe -> mesh, as NetCDF for the next stages and as VTU for ParaView."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.core.scene.load import read_toml

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.core.workflow.execute import Progress


def params(recipe: Path, edits: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The recipe's content; where it lies does not matter. Raises InputError when it cannot be read.

    edits: values that take the place of the recipe's; of `elements` a factor.
    """
    table = read_toml(recipe)
    changes = dict(edits or {})
    if "elements" in changes:
        changes["elements"] = changes["elements"] * table["elements"]
    return {"recipe": table | changes}


def run(params: Mapping[str, Any], inputs: Mapping[str, xr.Dataset], progress: Progress) -> dict[str, Any]:
    """The mesh (schema MESH) as ``nc``, and for other programs as ``vtu``."""
    from pipeline.structure.fe import mesh

    result = mesh.build(params["recipe"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.vtu"
        mesh.write_vtu(result, path)
        return {"nc": result, "vtu": path.read_bytes()}
