"""Stepped rods and rods with masses: frequencies, static compliance and rigid inertia against exact ones."""

import math
from typing import Any

import numpy as np
import pytest

from flexclear.pipeline.structure import closed_form
from flexclear.pipeline.structure.kinds import kind
from tests.analytic.beam_models import WITHOUT_SHAPE, lowest, order
from tests.analytic.beam_solutions import PAPER_ROD
from tests.analytic.stepped_rods import Lump, Piece, frequencies

E, G, RHO = PAPER_ROD.youngs_modulus, PAPER_ROD.shear_modulus, PAPER_ROD.density
STEEL = {"density": 7801.0, "youngs_modulus": 2.07e11, "poisson": 0.29}
#: a steel stem, the rod, and a thin rectangular tongue: ends [m], section, material
PLAN = (
    (0.0, 0.04, {"type": "circle", "radius": 0.008}, STEEL),
    (0.04, 0.18, {"type": "tube", "radius": 0.01, "inner_radius": 0.006}, None),
    (0.18, 0.24, {"type": "rectangle", "width": 0.02, "height": 0.012}, None),
)
#: table of St. Venant's constant, Timoshenko & Goodier, sec. 109: sides 20 x 12 mm, ratio 5/3, from the series itself
TONGUE_TORSION = (
    0.012**3
    * 0.02
    * (1.0 / 3.0 - 64.0 / math.pi**5 * 0.6 * sum(math.tanh(k * math.pi / 1.2) / k**5 for k in range(1, 4001, 2)))
)
BALL = {"x": 0.24, "mass": 0.35, "com": [0.012, 0.004, -0.003], "inertia": [6e-5, 8e-5, 9e-5]}
LUMP = Lump(after=2, mass=0.35, offset=(0.012, 0.004, -0.003), inertia=(6e-5, 8e-5, 9e-5))
KAPPA = (0.89, 0.7, 0.85)


def recipe(elements: tuple[int, int, int], theory: str, **changes: Any) -> dict[str, Any]:
    """The rod of PLAN; quadratic twist and extension, so that all converge with the fourth power."""
    segments = [
        {
            "start": start,
            "end": end,
            "elements": n,
            "section": section | {"shear_coefficient": kappa},
            **({"material": material} if material else {}),
        }
        for (start, end, section, material), n, kappa in zip(PLAN, elements, KAPPA, strict=True)
    ]
    shape = {"type": "segmented-beam", "length": 0.24, "segments": segments}
    return {
        **WITHOUT_SHAPE,
        "shape": shape,
        "theory": theory,
        "torsion": "quadratic",
        "extension": "quadratic",
        **changes,
    }


def pieces(theory: str) -> list[Piece]:
    """The same rod for the exact solution, section constants written out again."""
    ri, ro = 0.006, 0.01
    circle = math.pi * 0.008**4 / 4.0
    ring = math.pi * (ro**4 - ri**4) / 4.0
    b, h = 0.02, 0.012
    constants = (
        (math.pi * 0.008**2, 2.0 * circle, circle, circle, STEEL),
        (math.pi * (ro**2 - ri**2), 2.0 * ring, ring, ring, None),
        (b * h, TONGUE_TORSION, b * h**3 / 12.0, h * b**3 / 12.0, None),
    )
    found = []
    for (start, end, _, _), (area, torsion, y, z, steel), kappa in zip(PLAN, constants, KAPPA, strict=True):
        e, rho = (steel["youngs_modulus"], steel["density"]) if steel else (E, RHO)
        g = e / (2.0 * (1.0 + steel["poisson"])) if steel else G
        rotary = (rho * (y + z), *((0.0, 0.0) if theory == "euler-bernoulli" else (rho * y, rho * z)))
        shear = (kappa * g * area,) * 2 if theory == "timoshenko" else (math.inf, math.inf)
        found.append(Piece(end - start, e * area, g * torsion, (e * y, e * z), rho * area, rotary, shear))
    return found


ALL = "012345"


@pytest.mark.parametrize("theory", ["euler-bernoulli", "rayleigh", "timoshenko"])
@pytest.mark.parametrize("held", [("", ""), (ALL, ""), (ALL, ALL), ("0123", "12")], ids=["FF", "CF", "CC", "PP"])
def test_stepped_rods_have_the_exact_frequencies(held: tuple[str, str], theory: str) -> None:
    exact = frequencies(pieces(theory), [], held, 8)
    found = lowest(kind.build(recipe((4, 14, 6), theory)), *held, 8)
    assert np.max(found / exact - 1.0) < 1e-4  # 0.01 %
    # the exact frequencies themselves are bisected to 1e-10 and stiffnesses round at about that
    assert np.min(found / exact - 1.0) > -1e-9


@pytest.mark.parametrize("theory", ["rayleigh", "timoshenko"])
def test_a_ball_at_the_end_couples_bending_and_torsion_exactly(theory: str) -> None:
    exact = frequencies(pieces(theory), [LUMP], (ALL, ""), 6)
    found = lowest(kind.build(recipe((4, 14, 6), theory, masses={"ball": BALL})), ALL, "", 6)
    assert np.abs(found / exact - 1.0).max() < 1e-4
    bare = lowest(kind.build(recipe((4, 14, 6), theory)), ALL, "", 6)
    assert np.all(found < 0.9 * bare)  # so the ball is no detail


def test_stepped_rods_with_masses_converge_at_order_four() -> None:
    exact = frequencies(pieces("timoshenko"), [LUMP], ("", ""), 6)
    meshes = [(2, 6, 3), (4, 12, 6), (8, 24, 12)]
    rods = [kind.build(recipe(n, "timoshenko", masses={"ball": BALL})) for n in meshes]
    errors = [lowest(rod, "", "", 6) / exact - 1.0 for rod in rods]
    np.testing.assert_allclose(order([1, 2, 4], np.array(errors)), 4.0, atol=0.3)


@pytest.mark.parametrize(
    "held, ends", [((ALL, ""), "fixed-free"), ((ALL, ALL), "fixed-fixed"), (("", ""), "free-free")]
)
def test_closed_forms_miss_no_frequency(held: tuple[str, str], ends: str) -> None:
    """All families of a stubby rod against the count of the dynamic stiffness, past the second wave's cut-off."""
    length, area, second = 0.05, PAPER_ROD.area, PAPER_ROD.second_moment
    shear = 0.89 * G * area
    span = closed_form.Span(length, E * second, RHO * area, RHO * second, shear)
    rotary = (2.0 * RHO * second, RHO * second, RHO * second)
    rod = Piece(length, E * area, 2.0 * G * second, (E * second,) * 2, RHO * area, rotary, (shear, shear))
    bending = np.repeat(closed_form.bending(span, ends, 8), 2)
    waves = [closed_form.rod(math.sqrt(modulus / RHO), length, ends, 8) for modulus in (E, G)]
    expected = np.sort(np.concatenate([bending, *waves]))[:16]
    assert expected[-1] > math.sqrt(shear / (RHO * second)) / (2.0 * math.pi)
    np.testing.assert_allclose(frequencies([rod], [], held, 16, parts=8), expected, rtol=1e-8)


def test_each_cell_is_drawn_with_its_own_section() -> None:
    """Round cells stay round next to rectangular ones, and tubes have their outer radius."""
    rod = kind.build(recipe((1, 1, 1), "rayleigh"))
    outline = kind.of_mesh(rod).assemble(rod).drawn.outline
    assert outline is not None
    distance = np.linalg.norm(outline, axis=2)
    # lengths follow from areas and second moments by square roots, which round by some eps
    np.testing.assert_allclose(distance[0], 0.008, rtol=1e-13)
    np.testing.assert_allclose(distance[1], 0.01, rtol=1e-13)
    np.testing.assert_allclose(distance[2].max(), np.hypot(0.01, 0.006), rtol=1e-13)
