"""Static compliance of the mode sets between the rod's joints, against the full rod."""

from __future__ import annotations

from functools import cache

import numpy as np
import xarray as xr

from benchmarks.reference_conditions.design import FULL, PLACES, ROD, TOP, Case, modes, scene
from pipeline.core.errors import InputError
from pipeline.core.scene.load import read_toml
from pipeline.structure.fe import mesh
from pipeline.structure.modes import solve

#: directions in the axes of the rod's frames, z along the rod
AXIAL, BENDING, TORSION = "z", "x", "rz"


@cache
def rod(finer: int) -> xr.Dataset:
    """The paper's rod in cells."""
    from pathlib import Path

    recipe = read_toml(Path(scene(Case(0, FULL)).flexible()[ROD].mesh))
    return mesh.build(recipe | {"elements": finer * recipe["elements"]})


@cache
def solved(case: Case) -> xr.Dataset:
    """Modes (schema MODES) of a case; InputError for counts that cut a pair."""
    table = modes(case)
    count = None if table["count"] == "all" else table["count"]
    return solve(rod(case.finer), table["reference"], count, table["interfaces"])


def shares(case: Case) -> dict[str, float]:
    """Share of the full rod's compliance of the top with the prismatic joint's place held, by direction."""
    found = solved(case)["compliance_share"].sel(frame=TOP, frame_held=PLACES[case.place])
    return {d: float(found.sel(direction=d)) for d in (AXIAL, BENDING, TORSION)}


def full(place: int) -> dict[str, float]:
    """That compliance itself [m/N, rad/(N m)]."""
    found = solved(Case(place, FULL))["compliance_full"].sel(frame=TOP, frame_held=PLACES[place])
    return {d: float(found.sel(direction=d)) for d in (AXIAL, BENDING, TORSION)}


@cache
def whole(place: int, condition: str, count: int) -> int:
    """The least whole count that is not below `count`."""
    while True:
        try:
            solved(Case(place, condition, count))
        except InputError as error:
            if "cut a cluster" not in str(error):
                raise
            count += 1
        else:
            return count


def whole_counts(place: int, condition: str, most: int) -> list[int]:
    """Counts up to `most` that cut no pair."""
    found = []
    for count in range(1, most + 1):
        try:
            solved(Case(place, condition, count))
        except InputError:
            continue
        found.append(count)
    return found


def clamped_frequencies(finer: int, count: int) -> np.ndarray:
    """Frequencies [Hz] of the Craig-Bampton set at 0 mm on a finer mesh."""
    return np.asarray(solved(Case(0, "craig-bampton", count, finer=finer))["frequency"].values)
