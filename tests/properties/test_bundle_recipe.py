"""Recipes and meshes: what they hold and refuse, that other programs open them; bundles of the paper's rod."""

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import xarray as xr

from flexclear.stages import meshing
from flexclear.structure.fe.recipe import read_recipe
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError

MESHES = Path(__file__).parents[2] / "meshes"


@pytest.fixture
def recipe() -> dict[str, Any]:
    return read_recipe(MESHES / "actuated_rod.toml")


@pytest.mark.parametrize("path", sorted(MESHES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_recipe_builds_and_says_where_its_values_come_from(path: Path) -> None:
    rod = kind.build(read_recipe(path))
    assert rod.sizes["node"] == rod.sizes["cell"] + 1
    for part in ("shape", "material", "section", "elements"):
        assert meshing.sources(path)[part] == "Table 2"


def test_the_equal_area_square_changes_only_the_mass() -> None:
    circle, square = (
        kind.build(read_recipe(MESHES / f"{name}.toml")) for name in ("actuated_rod", "actuated_rod_square_inertia")
    )
    changed = [name for name in circle.data_vars if not circle[name].equals(square[name])]
    assert changed == ["inertia_moment"]
    ratio = (square["inertia_moment"] / circle["inertia_moment"]).values
    np.testing.assert_allclose(ratio, np.pi / 3.0, rtol=1e-14)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"section": {"type": "circle", "radius": "10 kg"}}, r"\[section\.radius\].*is a mass, but a length"),
        ({"inertia_section": {"type": "hexagon"}}, r"\[inertia_section\.type\].*hexagon"),
        ({"interfaces": ["bottom", "topp"]}, "interface 'topp' is not a frame of the recipe; did you mean 'top'"),
        ({"interfaces": ["top", "top"]}, "name a frame twice"),
        ({"frames": {}}, r"\[frames\]"),
        ({"length": "240 mm"}, r"\[length\]: unknown key"),
    ],
)
def test_mistakes_are_named(recipe: dict[str, Any], change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        kind.build(recipe | change)
    assert caught.value.exit_code == 2


def test_all_mistakes_are_named_at_once(recipe: dict[str, Any]) -> None:
    del recipe["material"]["density"]
    with pytest.raises(InputError, match=r"(?s)\[material\.density\]: is missing.*\[elements\]"):
        kind.build(recipe | {"elements": -3})


def test_raw_and_read_recipes_give_the_same_mesh(recipe: dict[str, Any]) -> None:
    """Text with units and SI numbers are the same recipe."""
    text = {**recipe, "shape": {"type": "straight-beam", "length": "24 cm", "source": "Table 2"}}
    xr.testing.assert_identical(kind.build(text), kind.build(recipe))


def test_other_programs_read_the_mesh(recipe: dict[str, Any], tmp_path: Path) -> None:
    rod = kind.build(recipe)
    (tmp_path / "rod.vtu").write_bytes(kind.of_mesh(rod).vtu(rod))
    read = meshio.read(tmp_path / "rod.vtu")
    np.testing.assert_array_equal(read.points, rod["node_position"])
    np.testing.assert_array_equal(read.cells_dict["line"], rod["cell_node"])
    np.testing.assert_array_equal(read.cell_data["area"][0], rod["area"])


def test_artifacts_survive_a_file(recipe: dict[str, Any], tmp_path: Path) -> None:
    rod = kind.build(recipe)
    modes = solve(rod, "free-free", 7)
    for name, data in {"mesh": rod, "modes": modes, "bundle": bundle.build(rod, modes)}.items():
        path = tmp_path / f"{name}.nc"
        data.to_netcdf(path)
        with xr.open_dataset(path) as read:
            xr.testing.assert_identical(read.load(), data)


# Modal mass, stiffness, frames and momentum -------------------------------------------------------------------------

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
