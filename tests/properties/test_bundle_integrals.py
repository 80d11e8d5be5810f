"""Modal mass, stiffness, frames and momentum of bundles of the paper's rod; integrals are in `test_beam_volume`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve

MESHES = Path(__file__).parents[2] / "meshes"
CASES = [
    ("actuated_rod", "free-free", 13),
    ("actuated_rod", "fixed-fixed", 7),
    ("actuated_rod", "craig-bampton", 13),
    ("actuated_rod", "craig-bampton", None),
    ("actuated_rod_square_inertia", "craig-bampton", 13),
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(map(str, case)))
def data(request: pytest.FixtureRequest) -> xr.Dataset:
    recipe, reference, count = request.param
    rod = kind.build(read_recipe(MESHES / f"{recipe}.toml"))
    return bundle.build(rod, solve(rod, reference, count))


def test_modal_mass_is_one_and_the_trace_of_the_moments(data: xr.Dataset) -> None:
    trace = np.einsum("kkij->ij", data["mode_mode_moment"].values)
    np.testing.assert_array_equal(data["modal_mass"].values, trace)
    # modes of the complete basis are combined through a mass matrix of condition 1e4: eps times that is 2.2e-12
    np.testing.assert_allclose(trace, np.eye(data.sizes["mode"]), rtol=0.0, atol=2.2e-12)


def test_stiffness_is_the_square_of_the_frequencies(data: xr.Dataset) -> None:
    omega = 2.0 * np.pi * data["frequency"].values
    np.testing.assert_array_equal(data["modal_stiffness"].values, np.diag(omega**2))
    assert np.all(np.diff(data["frequency"].values) >= -1e-6 * omega[1:])


def test_frames_ride_on_their_nodes(data: xr.Dataset) -> None:
    assert list(data["frame"].values) == ["bottom", "at_60mm", "at_120mm", "top"]
    for name, node in zip(data["frame"].values, (0, 3, 6, 12), strict=True):
        place = data.sel(frame=name)
        np.testing.assert_array_equal(place["frame_position"], data["node_position"][node])
        np.testing.assert_array_equal(place["frame_translation_shape"], data["shape_translation"][node])
        np.testing.assert_array_equal(place["frame_rotation_shape"], data["shape_rotation"][node])
        R = place["frame_rotation"].values
        np.testing.assert_array_equal(R @ R.T, np.eye(3))
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_array_equal(R[:, 2], [1.0, 0.0, 0.0])  # z of a frame along the rod
        np.testing.assert_array_equal(R[:, 0], [0.0, 1.0, 0.0])


@pytest.mark.parametrize("count", [7, 8, 13, None])
def test_free_free_modes_carry_no_momentum(count: int | None) -> None:
    """Mean axes: no linear momentum, and no angular momentum about any point."""
    rod = kind.build(read_recipe(MESHES / "actuated_rod.toml"))
    data = bundle.build(rod, solve(rod, "free-free", count))
    scale = np.sqrt(float(data["mass"]))
    assert np.abs(data["modal_first_moment"].values).max() < 1e-13 * scale
    P = data["position_mode_moment"].values
    assert np.abs(P - P.transpose(1, 0, 2)).max() < 1e-13 * scale * 0.24
