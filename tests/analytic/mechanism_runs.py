"""Runs of scenes for the tests, straight from the engine; each is made once per session."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import xarray as xr

from flexclear.commands import scenes as stages
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.progress import silent
from flexclear.stages.workplace import Workplace, open_workplace

TREE = Path(__file__).resolve().parents[2]
Overrides = tuple[tuple[str, object], ...]


@cache
def _place() -> Workplace:
    return open_workplace()


def bundles(scene: Scene) -> dict[str, xr.Dataset]:
    """The reduced flexible bodies of a scene, as the program makes them, kept as long as the tests run."""
    return stages.bundles(scene, _place())


def _table(value: object) -> object:
    pairs = isinstance(value, tuple) and all(isinstance(v, tuple) for v in value)
    return dict(value) if pairs else value  # type: ignore[call-overload]


@cache
def run(name: str, overrides: Overrides = ()) -> xr.Dataset:
    """The run of a scene; overrides as ((place, value), ...), a table as pairs too."""
    from flexclear.pipeline import dynamics

    scene = load_scene(TREE / "scenes" / f"{name}.toml", override={place: _table(value) for place, value in overrides})
    return dynamics.simulate(scene, bundles(scene), silent)


def impacts(dataset: xr.Dataset, least: float = 1e-4) -> dict[str, np.ndarray]:
    """Closings with an approach speed [m/s] above `least`, with their times, speeds, forces and rebounds."""
    time, speed = dataset.event_time.values, dataset.event_approach_speed.values
    kind = dataset.event_kind.values == "closing"
    ends = dataset.event_kind.values == "opening"
    contact, rebound = dataset.event_contact.values, np.full(len(kind), np.nan)
    for i in np.flatnonzero(kind):
        later = np.flatnonzero(ends[i:] & (contact[i:] == contact[i]))
        if len(later):
            rebound[i] = speed[i + later[0]]
    hard = kind & (speed > least)
    return {
        "start": time[hard],
        "approach": speed[hard],
        "separation": rebound[hard],
        "peak_force": dataset.event_peak_force.values[hard],
        "duration": dataset.event_duration.values[hard],
    }
