"""Interface that each kind of body implements for the stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.scene.registry import lookup
from flexclear.structure.fe.model import Model
from flexclear.structure.fe.recipe import parse
from flexclear.structure.kinds import name_of

FAMILY = "flexclear.structure.kinds"
#: name of a recipe in messages, where the caller has no better one
PLACE = "mesh recipe"


@dataclass(frozen=True)
class Kind:
    """Functions of one kind of body.

    build: the mesh dataset, from the recipe, the folder that its paths are relative to, and its name in messages.
    vtu: a VTU file of the mesh dataset, for ParaView.
    assemble: the model of the mesh dataset.
    words: one word for the motion of each mode, from its family and vectors of shape (ndof, n).
    exact: closed-form frequencies [Hz] next to those of a reference condition, by variable, from the modes'
        families and the interfaces' names; None for kinds without any.
    """

    build: Callable[[Any, Path, str], xr.Dataset]
    vtu: Callable[[xr.Dataset], bytes]
    assemble: Callable[[xr.Dataset], Model]
    words: Callable[[Model, list[str], np.ndarray], list[str]]
    exact: Callable[[xr.Dataset, str, list[str], tuple[str, ...]], dict[str, np.ndarray]] | None = None


def build(recipe: Mapping[str, Any], folder: str | Path = ".", where: str = PLACE) -> xr.Dataset:
    """Build the mesh dataset of a recipe's table; raise InputError for a wrong recipe or frames off the body.

    folder: base of relative paths in the recipe.  where: name of the recipe in messages.
    """
    kind: Kind = lookup(FAMILY, name_of(recipe), where="shape.type")
    return kind.build(parse(recipe, where), Path(folder), where)


def of_mesh(mesh: xr.Dataset) -> Kind:
    """Return the kind of body of a mesh dataset."""
    kind: Kind = lookup(FAMILY, str(mesh.attrs.get("body_kind", "beam")), where="mesh")
    return kind
