"""Meshes and models by the kind of body; bodies given by the matrices of another code, as a kind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from flexclear.structure.fe.exchange import matrices
from flexclear.structure.fe.model import Kind
from flexclear.structure.fe.recipe import parse
from flexclear.structure.kinds import beam, name_of, solid
from flexclear.system.errors import InputError

KINDS = {
    "beam": beam.KIND,
    "solid": solid.KIND,
    "matrices": Kind(
        build=matrices.build,
        vtu=matrices.as_vtu,
        assemble=matrices.assemble,
        words=lambda model, families, vectors: ["elastic"] * vectors.shape[1],
    ),
}
#: name of a recipe in messages, where the caller has no better one
PLACE = "mesh recipe"


def build(
    recipe: Mapping[str, Any],
    folder: str | Path = ".",
    where: str = PLACE,
    segment: Sequence[int] | None = None,
) -> xr.Dataset:
    """Build the mesh dataset of a recipe's table; raise InputError for a wrong recipe or frames off the body.

    folder: base of relative paths in the recipe.  where: name of the recipe in messages.  segment: of its rod, (k, n)
    for the k-th of n; default: the whole.
    """
    kind = KINDS[name_of(recipe)]
    mesh = kind.build(parse(recipe, where), Path(folder), where)
    if segment is None:
        return mesh
    if kind.cut is None:
        raise InputError(where, "is no rod, so that it has no segments", "remove segment")
    return kind.cut(mesh, segment)


def of_mesh(mesh: xr.Dataset) -> Kind:
    """Return the kind of body of a mesh dataset."""
    return KINDS[str(mesh.attrs.get("body_kind", "beam"))]
