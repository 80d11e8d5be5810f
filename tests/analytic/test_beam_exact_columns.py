"""Exact frequencies next to those of a mesh; normal modes of the paper, to every printed digit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexclear.pipeline.structure import closed_form
from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.beam_models import GENERAL, build

FINE: dict[str, Any] = {"elements": 24, "torsion": "quadratic", "extension": "quadratic"}
#: families of the lowest modes of the paper's rod, in ascending order
LOWEST = {
    **dict.fromkeys(
        ("free-free", "fixed-fixed"), ["bending_y", "bending_z"] * 2 + ["torsion"] + ["bending_y", "bending_z"]
    ),
    "cantilever": ["bending_y", "bending_z"] * 2 + ["torsion"] + ["bending_y", "bending_z"] + ["axial"],
    "pinned-pinned": ["bending_y", "bending_z"] * 2 + ["torsion"] + ["axial"] + ["bending_y", "bending_z"],
}
THEORIES = {"euler-bernoulli": "exact_euler_bernoulli", "rayleigh": "exact_rayleigh", "timoshenko": "exact_timoshenko"}


@pytest.mark.parametrize("theory", THEORIES)
@pytest.mark.parametrize("reference", LOWEST)
@pytest.mark.parametrize("interfaces", [("bottom", "top"), ("top", "bottom")])
def test_held_ends_have_their_exact_frequencies(reference: str, interfaces: tuple[str, str], theory: str) -> None:
    rod = build(**FINE, theory=theory)
    families = LOWEST[reference]
    found = solve(rod, reference, len(families), interfaces)["frequency"].values
    expected = closed_form.columns(rod, reference, families, interfaces)[THEORIES[theory]]
    # the third pair of bending with 24 elements: 3e-5
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_an_interface_inside_the_rod_has_no_closed_form() -> None:
    rod = build(frames={"bottom": {"x": 0.0}, "inside": {"x": 0.06}, "top": {"x": 0.24}})
    for reference in ("cantilever", "pinned-pinned"):
        assert closed_form.columns(rod, reference, ["bending_y"], ("inside", "top")) == {}
    assert closed_form.columns(rod, "craig-bampton", ["bending_y"], ("bottom", "top")) == {}


@pytest.mark.parametrize(
    "changes",
    [
        {"masses": {"ball": {"x": 0.24, "mass": 0.1}}},
        {"end_section": {"type": "circle", "radius": 0.008}},
        {"section": GENERAL | {"product": 2e-9}},
    ],
    ids=["mass", "taper", "skew"],
)
def test_other_rods_have_none(changes: dict[str, Any]) -> None:
    assert closed_form.columns(build(**changes), "free-free", ["bending_y"]) == {}


def test_a_section_without_kappa_has_no_timoshenko_column() -> None:
    columns = closed_form.columns(build(section=GENERAL), "free-free", ["bending_y"])
    assert set(columns) == {"exact_euler_bernoulli", "exact_rayleigh"}


def test_each_plane_has_its_own_second_moment_and_kappa() -> None:
    section = {"type": "rectangle", "width": 0.03, "height": 0.012, "shear_coefficient": [0.9, 0.6]}
    rod = build(**FINE | {"elements": 32}, theory="timoshenko", section=section)
    modes = solve(rod, "free-free", 8)
    bending = modes["kind"].values == "bending"
    # in y (30 mm) and in z (12 mm) the rod is stiff and soft; with one kappa for both one plane would be off by 1 %
    np.testing.assert_allclose(modes["frequency"].values[bending], modes["exact_timoshenko"].values[bending], rtol=1e-4)


# Tables 4 and 5 of Wang & Wang (2019) -------------------------------------------------------------------------------

MESHES = Path(__file__).parents[2] / "meshes"
#: Hz, elastic modes
PRINTED = {
    "fixed-fixed": (1576.8, 1576.8, 4314.2, 4314.2, 6403.6, 8362.7),  # Table 4
    "free-free": (1563.7, 1563.7, 4254.9, 4254.9, 6403.6, 8206.5),  # Table 5
}


@pytest.mark.parametrize("reference", PRINTED)
@pytest.mark.parametrize("recipe, agrees", [("actuated_rod_square_inertia.toml", True), ("actuated_rod.toml", False)])
def test_the_square_in_the_mass_has_every_printed_digit_and_the_circle_none(
    recipe: str, agrees: bool, reference: str
) -> None:
    """So the equal-area square is evidence, not a choice without effect."""
    found = solve(kind.build(read_recipe(MESHES / recipe)), reference, 7)["frequency"].values
    same = [round(float(f), 1) == printed for f, printed in zip(found, PRINTED[reference], strict=False)]
    assert set(same) == {agrees}


def test_six_rigid_modes_of_the_free_rod_are_zero() -> None:
    """Table 5 prints six zeros first."""
    modes = solve(kind.build(read_recipe(MESHES / "actuated_rod.toml")), "free-free", 7)
    assert modes.sizes["rigid_mode"] == 6
    # eps times the largest eigenvalue of 12 elements (1e6 Hz) is 0.01 Hz; the first elastic mode has 1564 Hz
    assert float(modes["rigid_frequency"].max()) < 0.05


def test_rigid_inertia_is_that_of_table_1() -> None:
    """Actuated rod: 0.21 kg, (996.802, 996.802, 10.330) kg mm^2, the last about its axis."""
    rod = kind.build(read_recipe(MESHES / "actuated_rod.toml"))
    data = bundle.build(rod, solve(rod, "free-free", 7))
    mass = float(data["mass"])
    com = data["first_moment"].values / mass
    second = data["second_moment"].values - mass * np.outer(com, com)
    inertia = (np.trace(second) * np.eye(3) - second) * 1e6
    assert round(mass, 2) == 0.21
    np.testing.assert_allclose(com, [0.12, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(inertia.diagonal(), [10.330, 996.802, 996.802], rtol=0.0, atol=5e-4)
    assert np.abs(inertia - np.diag(inertia.diagonal())).max() < 1e-12
