"""A planar mechanism is looked at along its normal, with up where it is up."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.post.render.view import plane, view


def moving(turn: np.ndarray, along: np.ndarray) -> xr.Dataset:
    """Two bodies that turn about `turn` and move along `along`, over time."""
    fraction = np.linspace(0.1, 1.0, 7)[:, None, None] * np.array([1.0, -0.5])[None, :, None]
    dims = ("time", "body", "axis")
    return xr.Dataset({"angular_velocity": (dims, fraction * turn), "velocity": (dims, fraction * along)})


@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 1, 0], [1, 2, -2]])
def test_the_normal_is_the_axis_of_turning(axis: list[float]):
    normal = np.array(axis) / np.linalg.norm(axis)
    in_plane = np.cross(normal, [0.3, -0.5, 0.8])
    found = plane(moving(normal, in_plane))
    assert found is not None
    assert abs(found @ normal) == pytest.approx(1.0, abs=1e-12)


def test_motion_out_of_the_plane_is_spatial():
    assert plane(moving(np.array([0.0, 0, 1]), np.array([1.0, 0, 0.1]))) is None
    assert plane(moving(np.zeros(3), np.array([1.0, 0, 0]))) is None  # along a line: any plane through it


def test_up_is_against_gravity_and_the_axis_across_runs_to_the_right():
    run = moving(np.array([0.0, 0, -1.0]), np.array([1.0, 0, 0]))
    told = {"load": {"g": {"type": "gravity", "acceleration": [0, -9.81, 0]}}}
    found = view(run, told)
    assert found.planar
    np.testing.assert_allclose(found.up, [0, 1, 0], atol=1e-12)
    assert found.direction[2] > 0.0  # from +z, so that x runs to the right
    assert np.cross(found.up, found.direction)[0] > 0.0


def test_a_wanted_direction_is_taken():
    found = view(moving(np.array([0.0, 0, 1]), np.array([1.0, 0, 0])), {}, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(found.direction / np.linalg.norm(found.direction), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found.up, [0, 0, 1], atol=1e-12)
