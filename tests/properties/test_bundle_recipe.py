"""Recipes and meshes: what they hold, what they refuse, and that other programs can open them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from flexclear.stages import meshing

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
        ({"interfaces": ["bottom", "topp"]}, "interface 'topp' is no frame of the recipe; did you mean 'top'"),
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
    with pytest.raises(InputError, match=r"(?s)\[elements\].*\[material\.density\]: is missing"):
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
