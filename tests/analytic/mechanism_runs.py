"""Runs of scenes for the tests, straight from the engine; each is made once per session."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flexclear import dynamics
from flexclear.dynamics import analyses
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import edited, load_scene
from flexclear.scene.schema import Scene
from flexclear.stages import scenes as stages
from flexclear.stages.workplace import Workplace, open_workplace
from flexclear.system.progress import silent
from tests.properties.mechanisms import simulated

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
def run(name: str, overrides: Overrides = (), *, horizon: bool = False) -> xr.Dataset:
    """The run of a scene; overrides as ((place, value), ...), a table as pairs too."""
    scene = load_scene(TREE / "scenes" / f"{name}.toml", override={place: _table(value) for place, value in overrides})
    return dynamics.simulate(scene, bundles(scene), silent) if horizon else simulated(scene, bundles(scene))


def of_kind(dataset: xr.Dataset, kind: str) -> np.ndarray:
    """Indices of the events of one kind."""
    return np.flatnonzero(dataset.event_kind.values == kind)


def impacts(dataset: xr.Dataset, least: float = 1e-4, contact: str | None = None) -> dict[str, np.ndarray]:
    """Closings with an approach speed [m/s] above `least`, of one contact or of all; with times, forces, rebounds."""
    time, speed = dataset.event_time.values, dataset.event_approach_speed.values
    name = dataset.event_contact.values
    openings = of_kind(dataset, "opening")
    hard = [k for k in of_kind(dataset, "closing") if speed[k] > least and contact in (None, name[k])]
    later = [[j for j in openings if j >= k and name[j] == name[k]] for k in hard]
    return {
        "start": time[hard],
        "approach": speed[hard],
        "separation": np.array([speed[after[0]] if after else np.nan for after in later]),
        "peak_force": dataset.event_peak_force.values[hard],
        "duration": dataset.event_duration.values[hard],
    }


def falls_through(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Times at which a sampled value falls through zero, on straight lines between samples."""
    k = np.flatnonzero((value[:-1] > 0.0) & (value[1:] <= 0.0))
    return time[k] + (time[k + 1] - time[k]) * value[k] / (value[k] - value[k + 1])


def tangential_force(dataset: xr.Dataset) -> np.ndarray:
    """Magnitudes of friction [N], shape (time, contact); a difference of squares keeps half of the digits."""
    square = (dataset.contact_force.values**2).sum(axis=2) - dataset.contact_normal_force.values**2
    return np.sqrt(np.maximum(0.0, square))


def require_coulomb(dataset: xr.Dataset, static: float = 0.15, within: float | None = None) -> None:
    """Friction never drives, and never exceeds static friction, within a force [N] (1e-6 of the largest)."""
    normal = dataset.contact_normal_force.values
    within = 1e-6 * normal.max() if within is None else within
    assert dataset.contact_friction_power.max() <= 0.0
    assert (tangential_force(dataset) <= static * normal + within).all()


@cache
def second_derivation(name: str) -> dict[str, np.ndarray]:
    """Numbers of the first layout by another derivation; the modules in tests/reference say how they are made."""
    text = (TREE / "tests" / "reference" / f"{name}.json").read_text()
    return {key: np.array(values) for key, values in json.loads(text).items()}


def platform_deviations(scene: str, ideal: str) -> tuple[float, float, float]:
    """Largest ones of the platform from an ideal run: rotation about y0 [rad], position [m], velocity [m/s]."""
    tight = run(ideal).sel(body="platform")
    other = run(scene).sel(body="platform").sel(time=tight.time, method="nearest", tolerance=1e-9)
    tilt = [np.arcsin(quaternion_to_matrix(d["quaternion"].values)[:, 0, 2]) for d in (tight, other)]
    place, speed = (np.abs(other[name].values - tight[name].values).max() for name in ("position", "velocity"))
    return float(np.abs(tilt[0] - tilt[1]).max()), float(place), float(speed)


@cache
def frequencies(name: str, overrides: Overrides = (), time: float | None = None, *, moving: bool = False) -> xr.Dataset:
    """The equilibrium and the natural vibrations of a scene; overrides as of runs."""
    scene = load_scene(TREE / "scenes" / f"{name}.toml", override=dict(overrides))
    return analyses.frequencies(scene, bundles(scene), silent, time, None, moving)


def with_sections(name: str, changes: dict[str, Any]) -> tuple[Scene, dict[str, xr.Dataset]]:
    """A scene whose flexible bodies are all recorded, and their bundles with what stress recovery needs."""
    scene = load_scene(TREE / "scenes" / f"{name}.toml", override=changes)
    scene = edited(scene, {"output.stress": list(scene.flexible())})
    return scene, bundles(scene)


def run_with_sections(name: str, changes: dict[str, Any]) -> xr.Dataset:
    """The run of such a scene."""
    return simulated(*with_sections(name, changes))
