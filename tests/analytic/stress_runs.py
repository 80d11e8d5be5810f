"""Runs with recorded section forces, straight from the engine; each is made once per session."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import xarray as xr

from pipeline.core.scene.load import edited, load_scene, read_toml
from pipeline.core.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE


def bundles(scene: Scene) -> dict[str, xr.Dataset]:
    """The reduced bodies of a scene with what stress recovery needs of them."""
    return {name: bundle(body.mesh, body.modes) for name, body in scene.flexible().items()}


@cache
def bundle(recipe: str, modes: Any) -> xr.Dataset:
    """One reduced body, through stages 1 to 3."""
    from pipeline.structure.fe import mesh
    from pipeline.structure.modes import bundle as bundling
    from pipeline.structure.modes.solution import solve
    from pipeline.structure.stress.beam import recover

    grid = mesh.build(read_toml(Path(recipe)))
    count = None if modes.count == "all" else modes.count
    found = solve(grid, modes.reference, count, interfaces=modes.interfaces)
    return bundling.build(grid, found, recover(grid, found))


def run(name: str, changes: dict[str, Any]) -> xr.Dataset:
    """The run of a scene with changes, all of its flexible bodies recorded."""
    from pipeline import dynamics

    scene = load_scene(TREE / "scenes" / f"{name}.toml", override=changes)
    scene = edited(scene, {"output.stress": list(scene.flexible())})
    return dynamics.simulate(scene, bundles(scene), lambda share, text: None)


def last(dataset: xr.Dataset) -> dict[str, Any]:
    """Forces, moments and peaks of every section at the last time, with the places of the sections."""
    now = dataset.isel(time=-1)
    names = ("section_place", "section_force", "section_moment", "peak_axial_stress", "peak_von_mises_stress")
    return {name: now[name].values for name in names}
