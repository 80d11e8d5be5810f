"""Recipes of small solids for the tests."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear.structure.kinds import kind

#: Wang & Wang (2019), Table 2
ALUMINIUM = {"density": 2740.0, "youngs_modulus": 7.17e10, "poisson": 0.33}
ROD_AXES = {"z": [1.0, 0.0, 0.0], "x": [0.0, 1.0, 0.0]}
ENDS = {name: {"on": {"region": region}} for name, region in (("bottom", "start"), ("top", "end"))}


def rod(element: str, cells: tuple[int, int, int], tie: str = "rigid") -> dict[str, Any]:
    """The paper's rod as a solid, framed as the beam of meshes/actuated_rod.toml is."""
    along, across, rings = cells
    return {
        "title": "rod",
        "interfaces": ["bottom", "top"],
        "shape": {
            "type": "cylinder",
            "radius": 0.01,
            "length": 0.24,
            "element": element,
            "cells": {"along": along, "across": across, "rings": rings},
        },
        "material": ALUMINIUM,
        "frames": {name: frame | {"tie": tie, "axes": ROD_AXES} for name, frame in ENDS.items()},
    }


def block(element: str, cells: tuple[int, int, int], size: tuple[float, float, float], tie: str) -> dict[str, Any]:
    """A box with both ends tied."""
    return {
        "interfaces": ["bottom", "top"],
        "shape": {"type": "block", "size": list(size), "element": element, "cells": list(cells)},
        "material": ALUMINIUM,
        "frames": {name: frame | {"tie": tie} for name, frame in ENDS.items()},
    }


def build(recipe: dict[str, Any], folder: Path = Path()) -> xr.Dataset:
    """The mesh dataset of a recipe."""
    return kind.build(recipe, folder)


def gauss(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (3, n^3) and weights of a product rule on the unit cube."""
    x, w = np.polynomial.legendre.leggauss(n)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    points = np.stack([part.ravel() for part in np.meshgrid(x, x, x, indexing="ij")])
    return points, np.einsum("i,j,k->ijk", w, w, w).ravel()
