"""Equilibria and natural vibrations of scenes for the tests, straight from the engine."""

from __future__ import annotations

from functools import cache

import xarray as xr

from flexclear.pipeline.core.scene.load import load_scene
from tests.analytic.mechanism_runs import TREE, Overrides, bundles


@cache
def frequencies(name: str, overrides: Overrides = (), time: float | None = None, *, moving: bool = False) -> xr.Dataset:
    """The vibrations of a scene; overrides as ((place, value), ...)."""
    from flexclear.pipeline import dynamics

    scene = load_scene(TREE / "scenes" / f"{name}.toml", override=dict(overrides))
    return dynamics.frequencies(scene, bundles(scene), lambda fraction, text: None, time, None, moving)
