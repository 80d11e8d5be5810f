"""Starts: what the scene gives is kept where the joints allow it, and refused where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline import dynamics
from pipeline.core.algebra import quaternion_to_matrix
from pipeline.core.errors import InputError
from pipeline.core.scene.load import load_scene
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties.mechanisms import simulate
from tests.properties.test_dynamics_cuts import two_loops


@pytest.mark.slow
def test_one_body_sets_its_whole_loop_in_motion() -> None:
    """From rest all accelerations are admissible velocities: given one body's as velocity, the others' must follow."""
    at_rest = simulate(two_loops(False)).isel(time=0)
    moving = two_loops(False)
    given = {name: at_rest.sel(body=name) for name in ("a", "d")}
    for name, start in given.items():
        moving["body"][name]["angular_velocity"] = start.angular_acceleration.values.tolist()
        moving["body"][name]["velocity"] = start.acceleration.values.tolist()
    found = simulate(moving).isel(time=0)
    size = float(np.abs(at_rest.acceleration).max())
    # rounding of the equations at rest
    assert found.velocity.values == pytest.approx(at_rest.acceleration.values, abs=1e-11 * size)
    assert found.angular_velocity.values == pytest.approx(at_rest.angular_acceleration.values, abs=1e-11 * size)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a", "d"])
def test_velocities_that_would_open_a_loop_are_refused(name: str) -> None:
    table = two_loops(False)
    table["body"][name]["angular_velocity"] = [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=f"velocities given for {name}") as error:
        simulate(table)
    assert f"[body.{name}.velocity]" in str(error.value)
    assert "miss by" in str(error.value)


#: length [m], density times area [kg/m], and radius [m] of meshes/actuated_rod.toml
LENGTH, LINE, SECTION = 0.24, 2740.0 * np.pi * 1e-4, 0.01
THROWN = {"body.rod.velocity": (1.0, -2.0, 0.5), "body.rod.angular_velocity": (3.0, 10.0, -8.0)}


@pytest.mark.parametrize("reference, stiffening", [("craig-bampton", None), ("free-free", {})])
def test_a_flexible_body_thrown_starts_with_the_velocity_of_its_centre_of_mass(
    reference: str, stiffening: object
) -> None:
    """As a rigid rod of its mass and inertia would; without weight its centre then goes straight on."""
    changes = {
        "joint": {}, "load": {}, "time.end": 0.01, "output.interval": 0.001, "body.rod.stiffening": stiffening,
        "body.rod.modes": {"reference": reference, "count": 13}, "body.rod.pose": {"rotation_vector": (0.3, -0.4, 0.5)},
    }  # fmt: skip
    scene = load_scene(TREE / "scenes" / "checks" / "swinging_rod.toml", {**changes, **THROWN})
    rod = dynamics.simulate(scene, bundles(scene), lambda share, text: None).sel(body="rod")
    v, omega = (np.array(value) for value in THROWN.values())
    # the speeds follow from a linear system of full rank
    assert rod.velocity.values[0] == pytest.approx(v, rel=0, abs=1e-12)
    assert rod.angular_velocity.values[0] == pytest.approx(omega, rel=0, abs=1e-12)
    mass, R = LINE * LENGTH, quaternion_to_matrix(rod["quaternion"].values[0])
    slender = mass * (LENGTH**2 / 12.0 + SECTION**2 / 4.0)
    inertia = R @ np.diag([mass * SECTION**2 / 2.0, slender, slender]) @ R.T
    # the mesh's own inertia: consistent masses of cubic elements are exact for rigid motions
    assert float(rod.kinetic[0]) == pytest.approx(0.5 * mass * v @ v + 0.5 * omega @ inertia @ omega, rel=1e-9)
    way = rod.position.values - rod.position.values[0]
    # rtol 1e-10 of a run of some hundred steps
    assert way == pytest.approx(np.outer(rod.time.values, v), rel=0, abs=1e-9)


def test_velocity_and_spin_of_a_hinged_flexible_rod_agree_about_its_hinge() -> None:
    """A rod on a ball joint is told its centre's velocity, omega x r: it starts without speeds of deformation."""
    omega = np.array([0.0, 4.0, 3.0])
    centre = np.cross(omega, [0.5 * LENGTH, 0.0, 0.0])
    changes = {"time.end": 1e-3, "output.interval": 1e-3, "body.rod.angular_velocity": tuple(omega)}
    place = TREE / "scenes" / "checks" / "swinging_rod.toml"
    scene = load_scene(place, {**changes, "body.rod.velocity": tuple(centre)})
    rod = dynamics.simulate(scene, bundles(scene), lambda share, text: None).sel(body="rod")
    assert rod.velocity.values[0] == pytest.approx(centre, rel=0, abs=1e-12)
    about_end = LINE * LENGTH * (LENGTH**2 / 3.0 + SECTION**2 / 4.0)
    assert float(rod.kinetic[0]) == pytest.approx(0.5 * about_end * omega @ omega, rel=1e-9)
