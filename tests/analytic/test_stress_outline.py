"""Stress maps of sections against closed forms and resultants; what is refused; what absent means."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.errors import InputError
from flexclear.pipeline.dynamics.record.stress import Motion, peak_stresses, section_forces
from flexclear.pipeline.structure.fe import section as sections
from flexclear.pipeline.structure.modes import bundle
from flexclear.pipeline.structure.modes.solution import solve
from flexclear.pipeline.structure.stress.beam import Outline, outline, recover
from flexclear.stages.graph import Graph
from tests.analytic.beam_models import GENERAL, build

NU = 0.33
R, HOLE, WIDTH, HEIGHT = 0.010, 0.006, 0.02, 0.03
CIRCLE, TUBE, BLOCK = sections.circle(R), sections.tube(R, HOLE), sections.rectangle(WIDTH, HEIGHT)
N, QY, QZ, T, MY, MZ = range(6)


def maps(name: str, given: sections.Section) -> Outline:
    found = outline((name,), given, NU)
    assert found is not None
    return found


def peaks(found: Outline, forces: list[float]) -> tuple[float, float]:
    """Largest axial and von Mises stress of one section under N, Qy, Qz, T, My, Mz."""
    data = xr.Dataset(
        {
            "fibre_stress": (("section", "fibre", "stress", "section_load"), found.stress[None]),
            "section_round": (("section",), np.array([found.round], dtype=np.int8)),
        }
    )
    axial, mises, _ = peak_stresses(data, np.array(forces)[None, None])
    return float(axial[0, 0]), float(mises[0, 0])


@pytest.mark.parametrize("nudge", [-1.0, 1.0])
def test_rounding_does_not_choose_between_tension_and_compression(nudge: float) -> None:
    """Two fibres at the same distance from the axis are stretched and pressed alike."""
    fibres = np.zeros((1, 2, 3, 6))
    fibres[0, :, 0, 4] = -1e6, 1e6 * (1.0 + nudge * np.finfo(float).eps)
    data = xr.Dataset(
        {
            "fibre_stress": (("section", "fibre", "stress", "load"), fibres),
            "section_round": (("section",), np.zeros(1, dtype=np.int8)),
        }
    )
    axial, _, _ = peak_stresses(data, np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0])[None, None])
    assert axial[0, 0] == pytest.approx(-2e6, rel=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.234, 2.9])
@pytest.mark.parametrize("pull", [300.0, -300.0])
def test_bending_of_a_round_rod_peaks_at_M_r_over_I_in_any_plane(pull: float, angle: float) -> None:
    """Exact, not to the spacing of fibres; pressure is shown by its sign."""
    moment = 12.0
    forces = [pull, 0.0, 0.0, 0.0, moment * np.cos(angle), moment * np.sin(angle)]
    expected = 300.0 / CIRCLE.area + moment * R / CIRCLE.second_y
    axial, mises = peaks(maps("circle", CIRCLE), forces)
    assert (axial, mises) == pytest.approx((np.sign(pull) * expected, expected), rel=1e-13)


def test_a_rectangle_peaks_at_its_corner() -> None:
    axial, _ = peaks(maps("rectangle", BLOCK), [0.0, 0.0, 0.0, 0.0, 7.0, 5.0])
    expected = 7.0 * 0.5 * HEIGHT / BLOCK.second_y + 5.0 * 0.5 * WIDTH / BLOCK.second_z
    assert axial == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name, given", [("circle", CIRCLE), ("tube", TUBE)])
def test_torsion_of_a_round_section_is_T_r_over_J(name: str, given: sections.Section) -> None:
    _, mises = peaks(maps(name, given), [0.0, 0.0, 0.0, 4.0, 0.0, 0.0])
    assert mises == pytest.approx(np.sqrt(3.0) * 4.0 * R / given.torsion, rel=1e-13)


def test_torsion_of_a_square_peaks_at_4_8_T_over_a_cubed() -> None:
    """Timoshenko & Goodier, table of sec. 109: 1 / 0.208 with three digits; more digits: 4.8039."""
    square = sections.square(0.02)
    _, mises = peaks(maps("rectangle", square), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    # 200 terms of 1/n^2 leave a thousandth of the series' last term at the middle of a side
    assert mises / np.sqrt(3.0) == pytest.approx(4.8039 / 0.02**3, rel=2e-3)


def test_shear_of_a_circle_is_St_Venants() -> None:
    """Centre and ends of the diameter across: (3 + 2 nu) / 8(1 + nu) and (1 + 2 nu) / 4(1 + nu) times Q r^2 / I."""
    found = maps("circle", CIRCLE).stress
    scale = R**2 / CIRCLE.second_y
    assert found[-1, 2, QZ] == pytest.approx((3 + 2 * NU) / (8 * (1 + NU)) * scale, rel=1e-13)
    assert found[0, 2, QZ] == pytest.approx((1 + 2 * NU) / (4 * (1 + NU)) * scale, rel=1e-13)


@pytest.mark.parametrize("name, given, rings", [("circle", CIRCLE, (R,)), ("tube", TUBE, (R, HOLE))])
def test_round_outlines_carry_no_shear_across_themselves(
    name: str, given: sections.Section, rings: tuple[float, ...]
) -> None:
    found = maps(name, given).stress
    angle = 2.0 * np.pi * np.arange(72) / 72
    for k in range(len(rings)):
        ring = found[72 * k : 72 * (k + 1)]
        across = ring[:, 1] * np.cos(angle)[:, None] + ring[:, 2] * np.sin(angle)[:, None]
        assert np.abs(across[:, [QY, QZ, T]]).max() <= 1e-12 * np.abs(ring[:, 1:, [QY, QZ, T]]).max()


@pytest.mark.parametrize("hole", [0.0, HOLE])
def test_shear_of_a_round_section_sums_to_its_force(hole: float) -> None:
    """Midpoint rule on rings made of the maps of thin tubes would hide the hole; so fibres of the solution itself."""
    from flexclear.pipeline.structure.stress.beam import _flexure

    n = 200
    r = hole + (np.arange(n) + 0.5) / n * (R - hole)
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    y, z = (np.outer(r, f(angle)).ravel() for f in (np.cos, np.sin))
    area = np.repeat(r, n) * (R - hole) / n * 2.0 * np.pi / n
    second = (TUBE if hole else CIRCLE).second_z
    along, across = _flexure(y, z, R, hole, NU, second)
    # second order in 1/200
    assert area @ along == pytest.approx(1.0, abs=2e-5)
    assert area @ across == pytest.approx(0.0, abs=1e-12)


# Rods ---------------------------------------------------------------------------------------------------------------


def reduced(**changes: Any) -> xr.Dataset:
    grid = build(**changes)
    found = solve(grid, "craig-bampton", 6)
    return bundle.build(grid, found, recover(grid, found, {}))


def test_a_tapered_tube_knows_its_end_sections() -> None:
    """Radii at the ends of the rod, from areas and second moments at Gauss points inside the cells."""
    thick = {"type": "tube", "radius": 0.02, "inner_radius": 0.01}
    thin = {"type": "tube", "radius": 0.01, "inner_radius": 0.004}
    found = reduced(section=thick, end_section=thin)
    for section, radius, hole in ((0, 0.02, 0.01), (-1, 0.01, 0.004)):
        bend = found["fibre_stress"].values[section, 0, 0, MZ]
        assert -bend == pytest.approx(radius / sections.tube(radius, hole).second_z, rel=1e-10)


def test_a_general_section_has_forces_but_no_stresses() -> None:
    found = reduced(section=GENERAL)
    assert "section_place" in found
    assert "fibre_stress" not in found


def test_a_lumped_mass_shows_as_a_jump() -> None:
    """1 kg in the middle, 10 mm next to the axis, pushed along the rod: N jumps by m a, Mz by m a times the arm."""
    lump = {"x": 0.12, "mass": 1.0, "com": [0.0, 0.01, 0.0], "inertia": [1e-4, 1e-4, 1e-4]}
    found = reduced(masses={"ball": lump})
    none, still, flat = np.zeros((1, 2, 3)), np.zeros((1, 3)), np.zeros((1, 6))
    motion = Motion(np.array([[5.0, 0.0, 0.0]]), still, still, flat, flat, flat)
    before, after = section_forces(found, motion, none, none)[0, 11:13]
    assert found["section_place"].values[[11, 12]] == pytest.approx([0.12, 0.12])
    assert before[0] - after[0] == pytest.approx(-5.0, rel=1e-12)
    assert before[5] - after[5] == pytest.approx(5.0 * 0.01, rel=1e-12)


# Scenes -------------------------------------------------------------------------------------------------------------


def clamped(root: Path, changes: dict[str, Any]) -> Graph:
    return Graph(load_scene(root / "scenes" / "checks" / "clamped_rod.toml", changes), shown=False)


def test_absent_means_not_in_any_key(root: Path) -> None:
    """Neither parameters nor modules of the tasks speak of stresses unless the scene does."""
    without, asked = clamped(root, {}), clamped(root, {"output.stress": ["rod"]})
    for graph, there in ((without, False), (asked, True)):
        bundles, simulate = graph.bundle["rod"], graph.simulate
        assert ("stress" in bundles.params) is there
        assert ("flexclear.pipeline.structure.stress.beam" in bundles.modules) is there
        assert ("stress" in simulate.params["scene"]["output"]) is there
        assert ("flexclear.pipeline.dynamics.record.stress" in simulate.modules) is there


@pytest.mark.parametrize("names", [["wall"], ["rod", "ground"], []])
def test_only_flexible_bodies_have_sections(root: Path, names: list[str]) -> None:
    with pytest.raises(InputError, match="output") as caught:
        clamped(root, {"output.stress": names})
    assert names == [] or names[-1] in str(caught.value)


def test_matrices_alone_are_refused_with_the_place(root: Path, tmp_path: Path) -> None:
    recipe = tmp_path / "part.toml"
    recipe.write_text('[shape]\ntype = "matrices"\n')
    graph = clamped(root, {"output.stress": ["rod"], "body.rod.mesh": str(recipe)})
    with pytest.raises(InputError, match=r"\[output\] stress.*matrices"):
        graph.up_to("bundle")
