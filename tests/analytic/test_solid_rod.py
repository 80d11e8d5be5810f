"""The paper's rod and a NAFEMS beam as solids, against exact beam theory."""

import numpy as np
import pytest

from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from tests.analytic.solid_models import ALUMINIUM, block, build, rod

#: exact Timoshenko (kappa 0.8886), torsion and axial frequencies [Hz] of the free rod, as in docs/paper.md
FREE = {"bending": [1552.611, 4145.937, 7790.921], "torsion": [6534.348], "axial": [10656.88]}
#: the same between clamped ends
CLAMPED = {"bending": [1529.021, 4046.799, 7553.206], "torsion": [6534.348]}


def by_kind(data: object, kind: str) -> np.ndarray:
    frequency, kinds = data["frequency"].values, data["kind"].values  # type: ignore[index]
    return frequency[kinds == kind]


@pytest.mark.parametrize(
    "element, cells, within",
    [
        ("hex20", (16, 2, 1), 4e-3),
        ("hex27", (16, 2, 1), 4e-3),
        pytest.param("hex27", (24, 4, 1), 3e-3, marks=pytest.mark.slow),
    ],
)
def test_the_free_solid_rod_is_a_timoshenko_beam(element: str, cells: tuple[int, int, int], within: float) -> None:
    """Mean ties stiffen nothing, so that the ends are free.

    The third pair converges to 0.28 % above Timoshenko's, whose kappa is a constant, and 16 cells add 0.07 %; the axial
    one lies 0.04 % below, since the solid's sections swell and so carry more inertia.
    """
    found = solve(build(rod(element, cells, "mean")), "free-free", 8)
    for kind, expected in FREE.items():
        exact = np.repeat(expected, 2) if kind == "bending" else expected
        np.testing.assert_allclose(by_kind(found, kind), exact, rtol=within)


def test_rigid_ends_are_stiffer_than_a_clamped_beams() -> None:
    """A rigid face can neither contract nor warp: bending 1.1 to 1.6 % above Timoshenko's, torsion the same."""
    rigid, mean = (solve(build(rod("hex20", (16, 2, 1), tie)), "fixed-fixed", 7) for tie in ("rigid", "mean"))
    theory = np.repeat(CLAMPED["bending"], 2)
    excess = by_kind(rigid, "bending") / theory - 1.0
    assert np.all((excess > 0.009) & (excess < 0.02))
    # ends held in the mean are the beam's again
    np.testing.assert_allclose(by_kind(mean, "bending"), theory, rtol=7e-3)
    for found in (rigid, mean):
        np.testing.assert_allclose(by_kind(found, "torsion"), CLAMPED["torsion"], rtol=1e-3)


def test_a_solid_takes_the_place_of_a_beam_in_a_bundle() -> None:
    """Frames, constraint modes and static compliance as of the beam: L / EA along, L^3/3EI + L/kGA across."""
    mesh = build(rod("hex20", (16, 2, 1), "mean"))
    data = bundle.build(mesh, solve(mesh, "craig-bampton", 13))
    E, G, A, I, L = 7.17e10, 7.17e10 / 2.66, np.pi * 1e-4, np.pi * 1e-8 / 4.0, 0.24
    found = data["compliance_full"].sel(frame="top", frame_held="bottom").values
    # eight quadratic sides of the section are 8e-4 of the area short, twice that of the second moment
    assert found[2] == pytest.approx(L / (E * A), rel=2e-3)
    assert found[0] == pytest.approx(L**3 / (3 * E * I) + L / (0.8886 * G * A), rel=3e-3)
    assert found[5] == pytest.approx(L / (G * 2.0 * I), rel=3e-3)
    np.testing.assert_allclose(data["compliance_share"].sel(frame="top", frame_held="bottom").values, 1.0, atol=1e-7)
    np.testing.assert_allclose(data["modal_mass"].values, np.eye(13), atol=1e-11)


def test_nafems_deep_beam() -> None:
    """NAFEMS FV5 (simply supported deep beam, 10 x 2 x 2 m): Timoshenko kappa 5/6, St Venant torsion, axial."""
    recipe = block("hex20", (10, 2, 2), (10.0, 2.0, 2.0), "mean")
    recipe["material"] = {"density": 8000.0, "youngs_modulus": 2e11, "poisson": 0.3}
    held = ("bottom.x", "bottom.y", "bottom.z", "bottom.rx", "top.y", "top.z")
    found = solve(build(recipe), "constrained", 9, held=held)
    bending, torsion, axial = (by_kind(found, kind) for kind in ("bending", "torsion", "axial"))
    # exact for the theory, from NAFEMS TNSB Rev 3 (1990) and recomputed: 42.609, 147.786 Hz; L/d = 5 is at the edge
    # of the theory, and the solid's supports hold means, not axes
    np.testing.assert_allclose(bending[:4], np.repeat([42.609, 147.786], 2), rtol=7e-3)
    np.testing.assert_allclose(torsion[0], 71.202, rtol=5e-3)
    np.testing.assert_allclose(axial[0], 125.0, rtol=2e-3)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"on": {"region": "strat"}}, r"\[frames.top.on.region\]: no region is called 'strat'\n.*'start'"),
        ({"on": {"plane": {"point": [240.0, 0, 0], "normal": [1, 0, 0]}}}, r"selects no node; .*\n.*units"),
        ({"on": {"cylinder": {"point": [0, 0, 0], "axis": [1, 0, 0], "radius": 0.02}}}, "selects no node"),
        ({"on": {"region": "start"}}, "'bottom' and 'top' tie the same nodes rigidly"),
        ({"on": {"region": "start", "sphere": {"centre": [0, 0, 0], "radius": 1.0}}}, "not region and sphere"),
        ({"on": {}}, "one of region, plane, cylinder, sphere says where, not none"),
        ({"tie": "glue"}, r"\[frames.top.tie\]"),
    ],
)
def test_frames_that_cannot_be_meant_are_refused(change: dict[str, object], message: str) -> None:
    recipe = rod("hex8", (2, 1, 1))
    recipe["frames"]["top"] = recipe["frames"]["top"] | change
    with pytest.raises(InputError, match=message):
        build(recipe)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"material": None}, "either `material`"),
        ({"materials": {"body": ALUMINIUM}}, "either `material`"),
        ({"material": None, "materials": {"steel": ALUMINIUM}}, r"\[materials.steel\].*\n.*known: body"),
        ({"interfaces": ["tpo"]}, r"'tpo' is no frame of the recipe; .*'top'"),
        ({"elements": 12}, r"\[elements\]: unknown key"),
    ],
)
def test_recipes_that_cannot_be_meant_are_refused(change: dict[str, object], message: str) -> None:
    recipe = rod("hex8", (2, 1, 1)) | change
    with pytest.raises(InputError, match=message):
        build({key: value for key, value in recipe.items() if value is not None})


def test_more_modes_than_the_mesh_has_are_refused() -> None:
    mesh = build(rod("hex8", (2, 1, 1)))
    with pytest.raises(InputError, match=r"5000 modes are asked for, the mesh has \d+ elastic coordinates"):
        solve(mesh, "craig-bampton", 5000)
