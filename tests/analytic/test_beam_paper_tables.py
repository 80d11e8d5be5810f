"""The normal-mode columns of Wang & Wang (2019), Tables 4 and 5, to every printed digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexclear.pipeline.structure.fe.recipe import read_recipe
from flexclear.pipeline.structure.kinds import kind
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve

MESHES = Path(__file__).parents[2] / "meshes"
#: Hz, elastic modes
PRINTED = {
    "fixed-fixed": (1576.8, 1576.8, 4314.2, 4314.2, 6403.6, 8362.7),  # Table 4
    "free-free": (1563.7, 1563.7, 4254.9, 4254.9, 6403.6, 8206.5),  # Table 5
}


def frequencies(recipe: str, reference: str) -> np.ndarray:
    return solve(kind.build(read_recipe(MESHES / recipe)), reference, 7)["frequency"].values


@pytest.mark.parametrize("reference", PRINTED)
def test_every_printed_digit_with_the_square_in_the_mass(reference: str) -> None:
    found = frequencies("actuated_rod_square_inertia.toml", reference)
    assert tuple(round(float(f), 1) for f in found[:6]) == PRINTED[reference]


@pytest.mark.parametrize("reference", PRINTED)
def test_the_circle_differs_in_the_printed_digits(reference: str) -> None:
    """So the equal-area square is evidence, not a choice without effect."""
    found = frequencies("actuated_rod.toml", reference)
    assert not np.any(np.isclose(found[:6], PRINTED[reference], atol=0.05, rtol=0.0))


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
