"""What a kind of body has to offer to the stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.core.scene.registry import lookup
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.fe.recipe import parse
from flexclear.pipeline.structure.kinds import name_of

FAMILY = "flexclear.pipeline.structure.kinds"
#: name of a recipe in messages, for callers that have no better one
PLACE = "mesh recipe"


@dataclass(frozen=True)
class Kind:
    """Functions of one kind of body.

    build: the recipe, the folder that files in it are relative to, and its name in messages, to the mesh dataset.
    vtu: the mesh dataset as a file that ParaView opens.
    assemble: the mesh dataset to matrices.
    words: what each mode does, in a word, from its family and vectors of shape (ndof, n).
    exact: closed-form frequencies [Hz] next to those of a reference condition, by variable, from the modes'
        families and the interfaces' names; None where there are none.
    """

    build: Callable[[Any, Path, str], xr.Dataset]
    vtu: Callable[[xr.Dataset], bytes]
    assemble: Callable[[xr.Dataset], Model]
    words: Callable[[Model, list[str], np.ndarray], list[str]]
    exact: Callable[[xr.Dataset, str, list[str], tuple[str, ...]], dict[str, np.ndarray]] | None = None


def build(recipe: Mapping[str, Any], folder: str | Path = ".", where: str = PLACE) -> xr.Dataset:
    """The mesh dataset of a recipe's table; InputError for a wrong one, and for frames that lie nowhere on the body.

    folder: what files in the recipe are relative to.  where: name of the recipe in messages.
    """
    kind: Kind = lookup(FAMILY, name_of(recipe), where="shape.type")
    return kind.build(parse(recipe, where), Path(folder), where)


def of_mesh(mesh: xr.Dataset) -> Kind:
    """The kind of body whose mesh dataset this is."""
    kind: Kind = lookup(FAMILY, str(mesh.attrs.get("body_kind", "beam")), where="mesh")
    return kind
