"""Bodies given by the matrices of another code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.pipeline.structure.fe.exchange import mesh as meshes
from flexclear.pipeline.structure.fe.exchange.model import assemble
from flexclear.pipeline.structure.fe.exchange.recipe import MatricesRecipe
from flexclear.pipeline.structure.fe.model import Model
from flexclear.pipeline.structure.fe.recipe import parse
from flexclear.pipeline.structure.kinds.kind import Kind

PLACE = "mesh recipe"


def _build(recipe: Mapping[str, Any], folder: Path) -> xr.Dataset:
    checked = parse(recipe, PLACE)
    assert isinstance(checked, MatricesRecipe)
    return meshes.build(checked, folder, PLACE)


def _words(model: Model, families: list[str], vectors: np.ndarray) -> list[str]:
    return ["elastic"] * vectors.shape[1]


KIND = Kind(build=_build, write_vtu=meshes.write_vtu, assemble=assemble, words=_words)
