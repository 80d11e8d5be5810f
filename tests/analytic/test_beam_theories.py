"""Each theory of beams, with all kinds of ends, against exact roots of its frequency equation; the paper's tables."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg

from flexclear.structure import closed_form
from flexclear.structure.closed_form import Span
from flexclear.structure.fe import beam
from flexclear.structure.fe.recipe import read_recipe
from flexclear.structure.fe.section import tube_shear_coefficient
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from tests.analytic.beam_models import (
    BENDING,
    BENDING_Z,
    EXTENSION,
    GENERAL,
    RECIPE,
    TORSION,
    WORDS,
    build,
    frequencies,
    held_system,
    order,
)
from tests.analytic.beam_solutions import PAPER_ROD, element_stiffness

E, G, RHO = PAPER_ROD.youngs_modulus, PAPER_ROD.shear_modulus, PAPER_ROD.density
A, I, L = PAPER_ROD.area, PAPER_ROD.second_moment, PAPER_ROD.length
SHEAR = tube_shear_coefficient(PAPER_ROD.poisson, 0.0) * G * A
SPANS = {
    "euler-bernoulli": Span(L, E * I, RHO * A),
    "rayleigh": Span(L, E * I, RHO * A, RHO * I),
    "timoshenko": Span(L, E * I, RHO * A, RHO * I, SHEAR),
}
ENDS = ("FF", "CC", "CF", "FC", "PP", "CP", "PF", "GG", "CG", "PG", "GF")
#: 0.01 %
WANTED = 1e-4
# Exact frequencies [Hz] of the paper's rod from a program of other authorship; P pinned, C clamped, F free.
INDEPENDENT = {
    ("FF", "euler-bernoulli"): (1581.1814568870293, 4358.587572621513, 8544.574354869366),
    ("FF", "rayleigh"): (1564.4634314776727, 4258.966722780683, 8217.501815180185),
    ("FF", "timoshenko"): (1552.6107500992712, 4145.937029758692, 7790.92146006871),
    ("CC", "euler-bernoulli"): (1581.1814568870293, 4358.587572621513, 8544.574354869366),
    ("CC", "rayleigh"): (1576.97623308615, 4315.6572692432455, 8366.836027329238),
    ("CC", "timoshenko"): (1529.0213628318904, 4046.798833914466, 7553.205806772877),
    ("CF", "euler-bernoulli"): (248.48644413848672, 1557.2379637700344, 4360.311390061857, 8544.47006488191),
    ("CF", "rayleigh"): (248.23615561158698, 1546.3922441874804, 4288.9550955593595, 8291.210028431868),
    ("CF", "timoshenko"): (247.492761124534, 1515.358647279601, 4098.005654619874, 7669.651775566156),
    ("PP", "euler-bernoulli"): (697.5120172690308, 2790.0480690761233, 6277.608155421278),
    ("PP", "rayleigh"): (696.0228399378884, 2766.44757081701, 6159.987654567392),
    ("PP", "timoshenko"): (691.6399647065812, 2700.2694227661304, 5853.678280140553),
}
# first three bending frequencies [Hz] of the paper's rod with kappa = 0.9, by an independent program
KAPPA_09 = {
    "FF": (1552.7587669133898, 4147.311964201585, 7795.930788610589),
    "CC": (1529.6005076471188, 4049.8981065578914, 7562.094331180602),
    "CF": (247.5021056692413, 1515.739289901413, 4100.261575308612),
}
# docs/structure.md, "How many elements"
DOCUMENTED = {
    ("rayleigh", 4): (1.3e-3, 9.2e-3, 2.2e-2),
    ("rayleigh", 8): (8.4e-5, 6.3e-4, 2.4e-3),
    ("rayleigh", 12): (1.7e-5, 1.3e-4, 4.8e-4),
    ("rayleigh", 18): (3.3e-6, 2.5e-5, 9.6e-5),
    ("timoshenko", 4): (1.2e-3, 8.1e-3, 1.9e-2),
    ("timoshenko", 8): (7.9e-5, 5.5e-4, 1.9e-3),
    ("timoshenko", 12): (1.6e-5, 1.1e-4, 3.9e-4),
    ("timoshenko", 18): (3.1e-6, 2.2e-5, 7.9e-5),
}
# beta L of Euler-Bernoulli beams, Blevins (1979), *Formulas for Natural Frequency and Mode Shape*, table 8-1
BLEVINS = {
    "CP": (3.92660231, 7.06858275, 10.21017612),
    "PF": (3.92660231, 7.06858275, 10.21017612),
    "CG": (2.36502037, 5.49780392, 8.63937983),
    "GF": (2.36502037, 5.49780392, 8.63937983),
    "PG": (math.pi / 2, 3 * math.pi / 2, 5 * math.pi / 2),
    "GG": (math.pi, 2 * math.pi, 3 * math.pi),
}


def words(ends: str) -> str:
    return "-".join(WORDS[letter] for letter in ends)


@pytest.mark.parametrize("ends, theory", INDEPENDENT)
def test_closed_forms_agree_with_an_independent_program(ends: str, theory: str) -> None:
    expected = INDEPENDENT[ends, theory]
    found = closed_form.bending_frequencies(SPANS[theory], words(ends), len(expected))
    np.testing.assert_allclose(found, expected, rtol=1e-11)  # both solve to rounding times a few


@pytest.mark.parametrize("ends", BLEVINS)
def test_closed_forms_have_the_printed_wave_numbers(ends: str) -> None:
    hertz = closed_form.bending_frequencies(SPANS["euler-bernoulli"], words(ends), 3)
    beta = (RHO * A / (E * I) * (2.0 * np.pi * hertz) ** 2) ** 0.25
    np.testing.assert_allclose(beta * L, BLEVINS[ends], rtol=0.0, atol=1e-8)  # eight printed decimals


@pytest.mark.parametrize("length", [0.24, 0.05, 0.02])
def test_pinned_timoshenko_rods_have_both_spectra(length: float) -> None:
    """Pinned at both ends sin(n pi x / L) solves the theory on both branches, n = 0 on the second one too."""
    span = Span(length, E * I, RHO * A, RHO * I, SHEAR)
    n = np.arange(60) * np.pi / length
    a, c, s = span.rotary / span.bending, span.line_mass / span.bending, span.line_mass / span.shear
    # omega^4 a s - omega^2 (n^2 (a + s) + c) + n^4 = 0; the lower root without cancellation
    b = n**2 * (a + s) + c
    upper = (b + np.sqrt(b**2 - 4.0 * a * s * n**4)) / (2.0 * a * s)
    lower = n[1:] ** 4 / (a * s * upper[1:])
    expected = np.sort(np.sqrt(np.concatenate([lower, upper])))[:12] / (2.0 * np.pi)
    cut_off = np.sqrt(span.shear / span.rotary) / (2.0 * np.pi)
    assert (expected[-1] > cut_off) == (length < 0.1)
    np.testing.assert_allclose(closed_form.bending_frequencies(span, "pinned-pinned", 12), expected, rtol=1e-10)


@pytest.mark.parametrize("theory, elements", DOCUMENTED)
def test_documented_errors_are_the_measured_ones(theory: str, elements: int) -> None:
    """The table in docs/structure.md: the worst of all ends, mode by mode.

    Eighteen elements give three modes within a hundredth of a percent.
    """
    rod = build(elements=elements, theory=theory)
    exact = np.array([closed_form.bending_frequencies(SPANS[theory], words(ends), 3) for ends in ENDS])
    found = np.array([frequencies(rod, BENDING, ends, 3) for ends in ENDS])
    error = found / exact - 1.0
    # two digits are printed
    np.testing.assert_allclose(error.max(axis=0), DOCUMENTED[theory, elements], rtol=0.05)
    # admissible shapes and exact integration: from above
    assert error.min() > 0.0
    assert elements < 18 or error.max() < WANTED


@pytest.mark.parametrize("theory", SPANS)
@pytest.mark.parametrize("ends", ["FF", "CC", "CF", "PP", "CP"])
def test_bending_converges_at_order_four_in_both_planes(ends: str, theory: str) -> None:
    exact = closed_form.bending_frequencies(SPANS[theory], words(ends), 2)
    elements = [8, 16, 32]
    for plane in (BENDING, BENDING_Z):
        error = [frequencies(build(elements=n, theory=theory), plane, ends, 2) / exact - 1.0 for n in elements]
        # the coarsest mesh is not quite in the asymptotic range
        np.testing.assert_allclose(order(elements, np.array(error)), 4.0, atol=0.15)


def test_condensing_the_unknowns_inside_a_timoshenko_cell_costs_two_orders() -> None:
    """Statically condensed it is the element of interdependent interpolation: exact in statics only."""
    exact = closed_form.bending_frequencies(SPANS["timoshenko"], "fixed-fixed", 2)
    elements, errors = [16, 32, 64], []
    for n in elements:
        K, M = held_system(build(elements=n, theory="timoshenko"), BENDING, "CC")
        nodal = 2 * (n - 1)
        shapes = np.vstack([np.eye(nodal), -np.linalg.solve(K[nodal:, nodal:], K[nodal:, :nodal])])
        values = scipy.linalg.eigvalsh(shapes.T @ K @ shapes, shapes.T @ M @ shapes)
        errors.append(np.sqrt(values[:2]) / (2.0 * np.pi) / exact - 1.0)
    np.testing.assert_allclose(order(elements, np.array(errors)), 2.0, atol=0.1)


def test_slender_timoshenko_rods_do_not_lock() -> None:
    """Two elements of a rod a thousand times longer than thick: the Hermite value, not many times it."""
    thin = RECIPE | {"elements": 2, "section": {"type": "circle", "radius": L / 1000.0}}
    shear, none = (
        frequencies(build(**thin | {"theory": theory}), BENDING, "CF", 2) for theory in ("timoshenko", "rayleigh")
    )
    # the exact ratio is 1 - O((r/L)^2), 1e-5 at the second mode; a locked element is off by factors
    np.testing.assert_allclose(shear, none, rtol=5e-5)


@pytest.mark.parametrize("ends", KAPPA_09)
def test_a_shear_coefficient_of_the_recipe_replaces_cowpers(ends: str) -> None:
    section = {"type": "circle", "radius": PAPER_ROD.radius, "shear_coefficient": 0.9}
    found = frequencies(build(elements=24, theory="timoshenko", section=section), BENDING, ends, 3)
    np.testing.assert_allclose(found, KAPPA_09[ends], rtol=WANTED)


@pytest.mark.parametrize("degree, elements, expected", [("linear", [8, 16, 32], 2.0), ("quadratic", [4, 8, 16], 4.0)])
@pytest.mark.parametrize("motion, name", [(TORSION, "torsion"), (EXTENSION, "extension")])
@pytest.mark.parametrize("ends", ["FF", "CC", "CF"])
def test_twist_and_extension_converge_at_twice_their_degree(
    ends: str, motion: tuple[int, ...], name: str, degree: str, elements: list[int], expected: float
) -> None:
    speed = math.sqrt((G if name == "torsion" else E) / RHO)
    exact = closed_form.rod_frequencies(speed, L, words(ends), 2)
    error = np.array(
        [frequencies(build(elements=n, **{name: degree}), motion, ends, 2) / exact - 1.0 for n in elements]
    )
    assert error.min() > 0.0
    np.testing.assert_allclose(order(elements, error), expected, atol=0.1)


@pytest.mark.parametrize("motion, name", [(TORSION, "torsion"), (EXTENSION, "extension")])
def test_resolution_of_the_first_twist_and_extension(motion: tuple[int, ...], name: str) -> None:
    """65 linear elements per half wave, or 6 quadratic ones: (pi/64)^2 / 24 is 0.01004 %, just too much."""
    exact = closed_form.rod_frequencies(math.sqrt((G if name == "torsion" else E) / RHO), L, "fixed-fixed", 1)
    for degree, enough, short in (("linear", 65, 64), ("quadratic", 6, 5)):
        good, bad = (
            float(frequencies(build(elements=n, **{name: degree}), motion, "CC", 1)[0] / exact[0] - 1.0)
            for n in (enough, short)
        )
        assert good < WANTED < bad


@pytest.mark.parametrize("elements", [12, 256])
def test_every_cell_has_the_textbook_stiffness(elements: int) -> None:
    """Also far from the origin, where elements built from global monomials lose six digits."""
    stiffness = beam.assemble(build(elements=elements)).stiffness.toarray()
    h = PAPER_ROD.length / elements
    expected = element_stiffness(PAPER_ROD, h)
    scale = np.sqrt(np.outer(expected.diagonal(), expected.diagonal()))
    # entries that couple two neighbouring nodes belong to one cell only
    for cell in (0, elements // 2, elements - 1):
        rows, columns = slice(6 * cell, 6 * cell + 6), slice(6 * cell + 6, 6 * cell + 12)
        error = np.abs(stiffness[rows, columns] - expected[:6, 6:]) / scale[:6, 6:]
        assert error.max() < 1e-12  # the node positions themselves round at 1e-16 L, cells are L/256
    assert np.abs(stiffness[:6, :6] - expected[:6, :6]).max() <= 1e-12 * expected.max()


# Exact frequencies next to those of a mesh ---------------------------------------------------------------------------

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
    expected = closed_form.exact_frequencies(rod, reference, families, interfaces)[THEORIES[theory]]
    # the third pair of bending with 24 elements: 3e-5
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_an_interface_inside_the_rod_has_no_closed_form() -> None:
    rod = build(frames={"bottom": {"x": 0.0}, "inside": {"x": 0.06}, "top": {"x": 0.24}})
    for reference in ("cantilever", "pinned-pinned"):
        assert closed_form.exact_frequencies(rod, reference, ["bending_y"], ("inside", "top")) == {}
    assert closed_form.exact_frequencies(rod, "craig-bampton", ["bending_y"], ("bottom", "top")) == {}


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
    assert closed_form.exact_frequencies(build(**changes), "free-free", ["bending_y"]) == {}


def test_a_section_without_kappa_has_no_timoshenko_column() -> None:
    columns = closed_form.exact_frequencies(build(section=GENERAL), "free-free", ["bending_y"])
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
