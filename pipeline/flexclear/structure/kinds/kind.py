"""Meshes and models by the kind of body."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr

from flexclear.structure.fe.recipe import parse
from flexclear.structure.kinds import beam, matrices, name_of, solid
from flexclear.structure.kinds.interface import Kind

KINDS = {"beam": beam.KIND, "solid": solid.KIND, "matrices": matrices.KIND}
#: name of a recipe in messages, where the caller has no better one
PLACE = "mesh recipe"


def build(recipe: Mapping[str, Any], folder: str | Path = ".", where: str = PLACE) -> xr.Dataset:
    """Build the mesh dataset of a recipe's table; raise InputError for a wrong recipe or frames off the body.

    folder: base of relative paths in the recipe.  where: name of the recipe in messages.
    """
    return KINDS[name_of(recipe)].build(parse(recipe, where), Path(folder), where)


def of_mesh(mesh: xr.Dataset) -> Kind:
    """Return the kind of body of a mesh dataset."""
    return KINDS[str(mesh.attrs.get("body_kind", "beam"))]
