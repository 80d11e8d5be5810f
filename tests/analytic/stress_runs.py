"""Runs with recorded section forces, straight from the engine."""

from typing import Any

import xarray as xr

from flexclear.pipeline.core.scene.load import edited, load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from tests.analytic.mechanism_runs import TREE, bundles


def recorded(name: str, changes: dict[str, Any]) -> tuple[Scene, dict[str, xr.Dataset]]:
    """A scene with changes, all of its flexible bodies recorded, and their bundles with what stress recovery needs."""
    scene = load_scene(TREE / "scenes" / f"{name}.toml", override=changes)
    scene = edited(scene, {"output.stress": list(scene.flexible())})
    return scene, bundles(scene)


def run(name: str, changes: dict[str, Any]) -> xr.Dataset:
    """The run of such a scene."""
    from flexclear.pipeline import dynamics

    return dynamics.simulate(*recorded(name, changes), silent)


def last(dataset: xr.Dataset) -> dict[str, Any]:
    """Forces, moments and peaks of every section at the last time, with the places of the sections."""
    now = dataset.isel(time=-1)
    names = ("section_place", "section_force", "section_moment", "peak_axial_stress", "peak_von_mises_stress")
    return {name: now[name].values for name in names}
