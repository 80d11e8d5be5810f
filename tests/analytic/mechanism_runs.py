"""Runs of scenes for the tests, straight from the engine; each is made once per session."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.core.scene.load import load_scene
from pipeline.core.scene.schema import Scene
from stages import s1_mesh, s2_modes, s3_bundle

TREE = Path(__file__).resolve().parents[2]
Overrides = tuple[tuple[str, object], ...]


def _table(value: object) -> object:
    pairs = isinstance(value, tuple) and all(isinstance(v, tuple) for v in value)
    return dict(value) if pairs else value  # type: ignore[call-overload]


@cache
def run(name: str, overrides: Overrides = ()) -> xr.Dataset:
    """The run of a scene; overrides as ((place, value), ...), a table as pairs too."""
    from pipeline import dynamics

    scene = load_scene(TREE / "scenes" / f"{name}.toml", override={place: _table(value) for place, value in overrides})
    return dynamics.simulate(scene, bundles(scene), lambda share, text: None)


def bundles(scene: Scene) -> dict[str, xr.Dataset]:
    """The reduced flexible bodies of a scene, through stages 1 to 3."""
    return {name: _bundle(body.mesh, *_asked(scene, name)) for name, body in scene.flexible().items()}


def _asked(scene: Scene, body: str) -> tuple[str, str]:
    """What stages 2 and 3 are told of a body, as text that a cache can compare."""
    return json.dumps(s2_modes.params(scene.flexible()[body])), json.dumps(s3_bundle.params(scene, body))


@cache
def _bundle(recipe: str, modes: str, bundle: str) -> xr.Dataset:
    mesh = s1_mesh.run(s1_mesh.params(Path(recipe)), {}, _quiet)["nc"]
    found = {"mesh": mesh, "modes": s2_modes.run(json.loads(modes), {"mesh": mesh}, _quiet)["nc"]}
    return s3_bundle.run(json.loads(bundle), found, _quiet)["nc"]


def _quiet(share: float | None, text: str) -> None:
    """Nobody watches."""


def impacts(dataset: xr.Dataset, least: float = 1e-4) -> dict[str, np.ndarray]:
    """Closings with an approach speed [m/s] above `least`, with their times, speeds, forces and rebounds."""
    time, speed = dataset.event_time.values, dataset.event_approach_speed.values
    meanings = dataset.event_kind.attrs["flag_meanings"].split()
    kind = dataset.event_kind.values == meanings.index("closing")
    ends = dataset.event_kind.values == meanings.index("opening")
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
