"""Loads and joints with several axes on a flexible rod: they reach its modes, and no energy is lost on the way."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.schema import Scene
from tests.analytic.mechanism_runs import TREE, bundles

LOADS: dict[str, Any] = {
    "gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -9.81]},
    "spring": {
        "type": "spring-damper", "between": ["base.hook", "rod.top"],
        "stiffness": 2e4, "damping": 5.0, "free_length": 0.05,
    },
    "push": {"type": "point-force", "frame": "rod.top", "force": [0.0, 20.0, 5.0], "axes": "frame"},
    "twist": {"type": "point-torque", "frame": "rod.top", "torque": [0.5, 0.0, 0.2]},
    "coil": {"type": "joint-spring", "joint": "U", "coordinate": "first", "stiffness": 30.0, "damping": 0.01},
    "rub": {"type": "joint-friction", "joint": "U", "coordinate": "second", "viscous": 0.02},
}  # fmt: skip
#: parallel to rod.bottom, whose z is along the rod, so that the joint's axes are square whichever frame is first
CROSS = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}


def scene(swapped: bool, driven: bool) -> Scene:
    between = ["rod.bottom", "base.U"] if swapped else ["base.U", "rod.bottom"]
    drive = {"type": "harmonic", "amplitude": [0.02], "frequency": ["20 Hz"], "phase": ["90 deg"], "offset": -0.02}
    table = {
        "title": "rod",
        "time": {"end": 0.01},
        "output": {"interval": 1e-3},
        "solver": {"rtol": 1e-10},
        "body": {
            "base": {"type": "ground", "frames": {"U": CROSS, "hook": {"position": [0.05, 0.0, 0.3]}}},
            "rod": {
                "type": "flexible",
                "mesh": str(TREE / "meshes" / "actuated_rod.toml"),
                "modes": {"reference": "craig-bampton", "count": 13, "interfaces": ["bottom", "top"]},
                "pose": {},
            },
        },
        "joint": {"U": {"type": "universal", "between": between}},
        "load": LOADS,
        "drive": {"second": {"joint": "U", "coordinate": "second", "law": drive}} if driven else {},
    }
    return Scene.model_validate(table)


@cache
def run(swapped: bool, driven: bool) -> xr.Dataset:
    made = scene(swapped, driven)
    return dynamics.simulate(made, bundles(made), lambda fraction, text: None)


@pytest.mark.slow
@pytest.mark.parametrize("driven", [False, True])
def test_the_energy_of_a_loaded_flexible_rod_is_accounted_for(driven: bool) -> None:
    dataset = run(False, driven)
    exchanged = float(np.abs(dataset.load_work).max() + dataset.kinetic.max() + dataset.elastic.max())
    assert float(dataset.modal_coordinate.std("time").max()) > 1e-7  # it vibrates
    # integrated at rtol 1e-10 over a thousand steps of the axial modes
    assert float(np.abs(dataset.energy_error).max()) < 1e-8 * exchanged


@pytest.mark.slow
def test_loads_on_a_rod_that_carries_the_joints_first_axis_are_accounted_for() -> None:
    """The tree meets the joint from its second frame; loads along its coordinates turn with the rod."""
    dataset = run(True, False)
    assert float(np.abs(dataset.joint_position.sel(coordinate="U.first")).max()) > 1e-3  # it turns
    exchanged = float(np.abs(dataset.load_work).max() + dataset.kinetic.max() + dataset.elastic.max())
    assert float(np.abs(dataset.energy_error).max()) < 1e-8 * exchanged
    first = dataset.sel(coordinate="U.first")
    assert dataset.load_length.sel(load="coil").values == pytest.approx(first.joint_position.values, abs=1e-10)
    torque = -30.0 * first.joint_position - 0.01 * first.joint_velocity
    power = (torque * first.joint_velocity).values
    assert dataset.load_power.sel(load="coil").values == pytest.approx(power, abs=1e-9)


@pytest.mark.slow
def test_a_spring_on_a_flexible_tip_has_the_length_between_its_frames() -> None:
    dataset = run(False, False)
    ends = dataset.frame_position.sel(frame=["base.hook", "rod.top"]).values
    assert dataset.load_length.sel(load="spring").values == pytest.approx(
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), abs=1e-13
    )
