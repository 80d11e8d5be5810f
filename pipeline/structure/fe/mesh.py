"""Stage 1 of beams: nodes, cells, constants and named frames from a recipe."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from flexclear.pipeline.structure.fe import beam_mesh
from flexclear.pipeline.structure.fe.beam_recipe import SegmentedBeamRecipe, StraightBeamRecipe
from flexclear.pipeline.structure.fe.recipe import parse, read_recipe

__all__ = ["build", "read_recipe", "write_vtu"]


def build(recipe: Mapping[str, Any], *, where: str = "mesh recipe") -> xr.Dataset:
    """The mesh dataset (schema MESH) of a recipe as `read_recipe` returns it.

    where: name of the recipe in messages.  Raises InputError for a wrong recipe, and for a frame or a mass
    that lies on no node (with the nearest nodes).
    """
    checked = parse(recipe, where)
    assert isinstance(checked, StraightBeamRecipe | SegmentedBeamRecipe)
    return beam_mesh.build(checked, where)


def write_vtu(mesh: xr.Dataset, path: str | Path) -> None:
    """Write the mesh as a VTU file (lines with section data per cell) that ParaView and meshio open."""
    import meshio  # slow to import and needed by this function alone

    names = ("area", "youngs_modulus", "shear_modulus", "density", "second_moment", "inertia_moment")
    cell_data = {name: [mesh[name].values] for name in names}
    meshio.Mesh(mesh["node_position"].values, [("line", mesh["cell_node"].values)], cell_data=cell_data).write(
        path, file_format="vtu"
    )
