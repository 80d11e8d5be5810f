"""Which exact frequencies stand beside those of a mesh, and that they belong to the same ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexclear.pipeline.structure.closed_form import comparison
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.beam_models import build

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
    expected = comparison.columns(rod, reference, families, interfaces)[THEORIES[theory]]
    # the third pair of bending with 24 elements: 3e-5
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_an_interface_inside_the_rod_has_no_closed_form() -> None:
    rod = build(frames={"bottom": {"x": 0.0}, "inside": {"x": 0.06}, "top": {"x": 0.24}})
    for reference in ("cantilever", "pinned-pinned"):
        assert comparison.columns(rod, reference, ["bending_y"], ("inside", "top")) == {}
    assert comparison.columns(rod, "craig-bampton", ["bending_y"], ("bottom", "top")) == {}


@pytest.mark.parametrize(
    "changes",
    [
        {"masses": {"ball": {"x": 0.24, "mass": 0.1}}},
        {"end_section": {"type": "circle", "radius": 0.008}},
        {
            "section": {
                "type": "general",
                "area": 3e-4,
                "torsion": 1e-8,
                "second_y": 8e-9,
                "second_z": 5e-9,
                "product": 2e-9,
            }
        },
    ],
    ids=["mass", "taper", "skew"],
)
def test_other_rods_have_none(changes: dict[str, Any]) -> None:
    assert comparison.columns(build(**changes), "free-free", ["bending_y"]) == {}


def test_a_section_without_kappa_has_no_timoshenko_column() -> None:
    section = {"type": "general", "area": 3e-4, "torsion": 1e-8, "second_y": 8e-9, "second_z": 5e-9}
    assert set(comparison.columns(build(section=section), "free-free", ["bending_y"])) == {
        "exact_euler_bernoulli",
        "exact_rayleigh",
    }


def test_each_plane_has_its_own_second_moment_and_kappa() -> None:
    section = {"type": "rectangle", "width": 0.03, "height": 0.012, "shear_coefficient": [0.9, 0.6]}
    rod = build(**FINE | {"elements": 32}, theory="timoshenko", section=section)
    modes = solve(rod, "free-free", 8)
    bending = modes["kind"].values == "bending"
    # in y (30 mm) and in z (12 mm) the rod is stiff and soft; with one kappa for both one plane would be off by 1 %
    np.testing.assert_allclose(modes["frequency"].values[bending], modes["exact_timoshenko"].values[bending], rtol=1e-4)
