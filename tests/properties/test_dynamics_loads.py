"""Loads act as they say: on both sides alike, at the power that the ledger books, whichever way the scene stands."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.dynamics import loads
from flexclear.scene.schema import Scene
from tests.properties.mechanisms import GRAVITY, body, frame, joint, matrix, scene, simulate, turned

WAVE = {"type": "harmonic", "amplitude": [2.0], "frequency": ["3 Hz"], "offset": 1.0}
WAVE_OF_LENGTH = {**WAVE, "amplitude": [0.02], "offset": 0.1}
#: every load but gravity, on a free body, on joints with one and several axes, and on the ground
LOADS: dict[str, Any] = {
    "push": {"type": "point-force", "frame": "c.tip", "force": [3.0, WAVE, -1.0]},
    "follow": {"type": "point-force", "frame": "b.end", "force": [0.0, 2.0, WAVE], "axes": "frame"},
    "twist": {"type": "point-torque", "frame": "b.end", "torque": [0.1, WAVE, 0.0], "axes": "frame"},
    "turn": {"type": "point-torque", "frame": "a.far", "torque": [0.0, 0.2, WAVE]},
    "spring": {
        "type": "spring-damper", "between": ["base.hook", "b.end"],
        "stiffness": 60.0, "damping": 2.0, "free_length": 0.3,
    },
    "tie": {"type": "spring-damper", "between": ["b.end", "c.tip"], "stiffness": 20.0, "free_length": 0.1},
    "mount": {
        "type": "bushing", "between": ["a.far", "c.tip"],
        "stiffness": [
            [40.0, 5.0, 0.0, 1.0, 0.0, 0.0], [5.0, 60.0, -8.0, 0.0, 2.0, 0.0], [0.0, -8.0, 50.0, 0.0, 0.0, -1.5],
            [1.0, 0.0, 0.0, 0.9, 0.2, 0.0], [0.0, 2.0, 0.0, 0.2, 1.1, 0.3], [0.0, 0.0, -1.5, 0.0, 0.3, 0.7],
        ],
        "damping": [0.3, 0.2, 0.4, 0.01, 0.02, 0.03],
    },
    "motor": {"type": "joint-force", "joint": "U", "coordinate": "second", "force": WAVE},
    "coil": {
        "type": "joint-spring", "joint": "U", "coordinate": "first", "stiffness": 4.0, "damping": 0.1, "rest": 0.5,
    },
    "rail": {"type": "joint-spring", "joint": "Y", "coordinate": "translation", "stiffness": 90.0, "damping": 1.0},
    "servo": {
        "type": "pid", "joint": "U", "coordinate": "second", "measured": "U.first", "reference": 0.2,
        "proportional": 0.3, "integral": 0.5, "derivative": 0.02, "limits": [-0.2, 0.1],
    },
    "digital": {
        "type": "sampled-pid", "joint": "Y", "coordinate": "translation", "reference": WAVE_OF_LENGTH,
        "proportional": 9.0, "integral": 5.0, "derivative": 0.1, "period": 0.02,
    },
    "rub": {
        "type": "joint-friction", "joint": "Y", "coordinate": "rotation", "viscous": 0.02,
        "coulomb": {"static": 0.05, "dynamic": 0.04, "v_static": 0.5, "v_dynamic": 1.0},
    },
}  # fmt: skip
TURN, SHIFT = matrix((0.7, -1.9, 0.4)), np.array([3.0, -2.0, 5.0])


def loaded(R: np.ndarray = np.eye(3), shift: np.ndarray = np.zeros(3)) -> dict[str, Any]:  # noqa: B008
    """Ground-universal-a-cylindrical-b and a free body c, all turned by R and shifted."""
    bodies = {
        "base": {
            "type": "ground",
            "frames": {"U": frame((0.0, 0.0, 0.0), (0.3, -0.2, 0.1)), "hook": frame((0.2, 0.5, 0.3))},
        },
        "a": body(
            (0.0, 0.0, 0.0),
            frames={"U": frame((0.0, 0.0, 0.0), (0.3, -0.2, 0.1)), "far": frame((0.3, 0.0, 0.1), (-0.1, 0.4, 0.2))},
        ),
        "b": body(
            (0.3, 0.0, 0.1),
            frames={"Y": frame((0.0, 0.0, 0.0), (-0.1, 0.4, 0.2)), "end": frame((0.2, 0.3, 0.1), (1.0, 0.0, 0.5))},
        ),
        "c": body(
            (0.6, 0.5, 0.2), frames={"tip": frame((0.1, 0.05, 0.0))}, angular_velocity=turned(R, (1.0, 2.0, -1.0))
        ),
    }
    for part in bodies.values():
        poses = part["frames"].values() if part["type"] == "ground" else [part["pose"]]
        for pose in poses:
            pose["position"] = list(R @ np.array(pose["position"]) + shift)
            own = matrix(pose.pop("rotation_vector", (0.0, 0.0, 0.0)))
            pose["axes"] = [turned(R @ own, axis) for axis in np.eye(3)]
    joints = {"U": joint("universal", "base.U", "a.U"), "Y": joint("cylindrical", "a.far", "b.Y")}
    loads = {**GRAVITY, **LOADS}
    loads["gravity"] = {"type": "gravity", "acceleration": turned(R, (0.0, 0.0, -9.81))}
    return scene(bodies, joints, end=0.4, rtol=1e-11, load=loads, output={"interval": 0.004})


def in_the_world(table: dict[str, Any], R: np.ndarray) -> dict[str, Any]:
    """The same scene with loads that are fixed in the world turned as well."""
    for name, key in (("push", "force"), ("turn", "torque")):
        part = table["load"][name]
        parts = [_times(part[key], row) for row in R]
        table["load"][name] = {**part, key: parts}
    return table


def _times(components: list[Any], row: np.ndarray) -> dict[str, Any]:
    constant = sum(float(r) * c for r, c in zip(row, components, strict=True) if not isinstance(c, dict))
    fraction = sum(float(r) for r, c in zip(row, components, strict=True) if isinstance(c, dict))
    return {**WAVE, "amplitude": [2.0 * fraction], "offset": fraction + constant}


@cache
def run() -> xr.Dataset:
    return simulate(loaded())


def test_every_load_is_tried_here() -> None:
    # those by expressions: tests/analytic/test_expressions.py; films: tests/analytic/test_films.py
    elsewhere = {"gravity", "film", "joint-expression", "line-expression", "point-expression"}
    assert {part["type"] for part in LOADS.values()} == set(loads.LOADS) - elsewhere


def test_the_energy_is_accounted_for() -> None:
    dataset = run()
    exchanged = float(np.abs(dataset.load_work).max() + dataset.dissipated.max() + dataset.kinetic.max())
    assert exchanged > 1.0
    # integrated next to the motion at rtol 1e-11, some hundred steps
    assert float(np.abs(dataset.energy_error).max()) < 1e-8 * exchanged
    assert np.all(np.diff(dataset.dissipated) > 0.0)


def test_powers_are_rates_of_what_loads_do() -> None:
    """Work, losses and stored energy change at the sum of all powers; trapezoids over 4 ms tell it to a percent."""
    dataset = run()
    supplied = dataset.load_work - dataset.dissipated - dataset.elastic
    power = dataset.load_power.sum("load")
    by_trapezoid = np.cumsum(0.5 * (power.values[1:] + power.values[:-1]) * np.diff(dataset.time))
    change = (supplied - supplied.isel(time=0)).values[1:]
    assert by_trapezoid == pytest.approx(change, abs=0.01 * np.abs(change).max())


def test_springs_pull_by_their_law_along_their_line() -> None:
    dataset = run()
    ends = dataset.frame_position.sel(frame=["base.hook", "b.end"]).values
    line = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(line, axis=1)
    spring = dataset.sel(load="spring")
    assert spring.load_length.values == pytest.approx(length, abs=1e-14)
    tension = -np.einsum("ti,ti->t", spring.load_force.values, line) / length
    # tension = k (l - l0) + c l', which gives l', and power = -tension l'
    rate = (tension - 60.0 * (length - 0.3)) / 2.0
    assert spring.load_power.values == pytest.approx(-tension * rate, abs=1e-11)
    across = np.cross(spring.load_force.values, line)
    assert np.abs(across).max() < 1e-13
    assert np.abs(spring.load_moment.values).max() < 1e-13


def test_joint_loads_follow_their_coordinates() -> None:
    dataset = run()
    coil, rail, rub = (dataset.sel(load=name) for name in ("coil", "rail", "rub"))
    first = dataset.sel(coordinate="U.first")
    assert coil.load_length.values == pytest.approx(first.joint_position.values, abs=1e-13)
    torque = -4.0 * (first.joint_position - 0.5) - 0.1 * first.joint_velocity
    assert np.linalg.norm(coil.load_moment.values, axis=1) == pytest.approx(np.abs(torque.values), abs=1e-13)
    assert coil.load_power.values == pytest.approx((torque * first.joint_velocity).values, abs=1e-12)
    slide = dataset.sel(coordinate="Y.translation")
    force = -90.0 * slide.joint_position - slide.joint_velocity
    assert np.linalg.norm(rail.load_force.values, axis=1) == pytest.approx(np.abs(force.values), abs=1e-12)
    turning = dataset.sel(coordinate="Y.rotation").joint_velocity.values
    assert np.all(rub.load_power.values <= 0.0)
    fast = np.abs(turning) > 1.0
    assert fast.any()
    known = -0.02 * turning[fast] ** 2 - 0.04 * np.abs(turning[fast])
    assert rub.load_power.values[fast] == pytest.approx(known, rel=1e-12)


def test_a_scene_with_loads_turned_and_shifted_moves_just_as_it_did() -> None:
    here, there = run(), simulate(in_the_world(loaded(TURN, SHIFT), TURN))
    # rtol 1e-11 over some hundred steps, which differ: a vector's largest component depends on the axes
    assert there.position.values == pytest.approx(here.position.values @ TURN.T + SHIFT, abs=1e-8)
    for name in ("load_force", "load_moment", "joint_force", "joint_moment"):
        known = here[name].values @ TURN.T
        assert there[name].values == pytest.approx(known, abs=1e-7 * np.abs(known).max()), name
    for name in ("load_length", "load_power", "joint_position", "kinetic", "dissipated", "load_work"):
        assert there[name].values == pytest.approx(here[name].values, abs=1e-7 * np.abs(here[name].values).max()), name


def test_forces_and_loads_change_momentum_and_nothing_else_does() -> None:
    """Newton for the free body: what is recorded of loads and accelerations is one motion."""
    dataset = run()
    free = dataset.sel(body="c")
    force = sum(dataset.load_force.sel(load=name).values for name in ("push", "tie", "mount"))
    assert free.acceleration.values == pytest.approx(force + np.array([0.0, 0.0, -9.81]), abs=1e-10)


def test_scenes_keep_their_loads() -> None:
    """What a scene says comes back the same from its own table."""
    table = Scene.model_validate(loaded())
    assert Scene.model_validate(table.model_dump(mode="json")) == table
