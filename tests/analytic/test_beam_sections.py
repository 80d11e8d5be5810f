"""Section constants against tables and exact solutions, sections in skew axes; recipes of beams that are wrong."""

from typing import Any

import numpy as np
import pytest

from flexclear.structure.fe import section
from flexclear.structure.kinds import kind
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from flexclear.system.errors import InputError
from tests.analytic.beam_models import GENERAL, RECIPE, WITHOUT_SHAPE, build, lowest

# Timoshenko & Goodier, *Theory of Elasticity*, sec. 109: J = k1 b a^3 by b/a, printed digits
PRINTED_TORSION = {1.0: 0.1406, 1.2: 0.166, 1.5: 0.196, 2.0: 0.229, 2.5: 0.249, 3.0: 0.263, 4.0: 0.281, 10.0: 0.312}
# Cowper (1966), table 1 for nu = 0.3
COWPER = {"circle": 0.886, "rectangle": 0.850, "thin tube": 0.531}


@pytest.mark.parametrize("ratio", PRINTED_TORSION)
def test_torsion_of_rectangles_is_the_printed_one(ratio: float) -> None:
    found = section.rectangle_torsion(0.02 * ratio, 0.02) / (ratio * 0.02**4)
    assert found == pytest.approx(PRINTED_TORSION[ratio], abs=6e-4)  # three digits are printed
    assert section.rectangle_torsion(0.02, 0.02 * ratio) == section.rectangle_torsion(0.02 * ratio, 0.02)


def test_shear_coefficients_are_cowpers() -> None:
    assert section.tube_shear_coefficient(0.3, 0.0) == pytest.approx(COWPER["circle"], abs=5e-4)
    assert section.rectangle_shear_coefficient(0.3) == pytest.approx(COWPER["rectangle"], abs=5e-4)
    assert section.tube_shear_coefficient(0.3, 1.0) == pytest.approx(COWPER["thin tube"], abs=5e-4)
    # a thin wall has 2 (1 + nu) / (4 + 3 nu)
    assert section.tube_shear_coefficient(0.3, 1.0) == pytest.approx(2.6 / 4.9, rel=1e-15)


def rotated(angle: float, **more: Any) -> dict[str, Any]:
    """The constants of a 30 x 12 mm rectangle, its sides turned by `angle` about the rod."""
    flat = section.rectangle(0.03, 0.012)
    mean, half = 0.5 * (flat.second_z + flat.second_y), 0.5 * (flat.second_z - flat.second_y)
    return {
        "type": "general",
        "area": flat.area,
        "torsion": flat.torsion,
        "second_z": mean + half * np.cos(2.0 * angle),
        "second_y": mean - half * np.cos(2.0 * angle),
        "product": half * np.sin(2.0 * angle),
        **more,
    }


@pytest.mark.parametrize("theory", ["euler-bernoulli", "rayleigh", "timoshenko"])
def test_skew_axes_change_no_frequency(theory: str) -> None:
    flat = {"type": "rectangle", "width": 0.03, "height": 0.012, "shear_coefficient": 0.85}
    principal = lowest(build(theory=theory, section=flat), "", "", 14)
    skew = lowest(build(theory=theory, section=rotated(0.6, shear_coefficient=0.85)), "", "", 14)
    np.testing.assert_allclose(skew, principal, rtol=1e-9)  # dense solver on a spectrum of 1e7


def test_skew_axes_are_the_rod_turned_about_itself() -> None:
    """Every invariant of the reduced rod, not only its frequencies."""
    turned = {"rotation_vector": [0.6, 0.0, 0.0]}
    flat = {"type": "rectangle", "width": 0.03, "height": 0.012}
    # the rod's own y and z stay along the mesh axes in one, turn with the rectangle in the other
    skew, rigid = build(section=rotated(0.6)), build(section=flat, pose=turned)
    a, b = (bundle.build(rod, solve(rod, "free-free", 6)) for rod in (skew, rigid))
    np.testing.assert_allclose(a["frequency"], b["frequency"], rtol=1e-9)
    np.testing.assert_allclose(a["second_moment"], b["second_moment"], rtol=1e-12, atol=1e-18)
    signs = np.sign(np.einsum("nkj,nkj->j", a["shape_translation"].values, b["shape_translation"].values))
    # torsion has no translation
    signs[signs == 0.0] = 1.0
    found = np.abs(np.einsum("kkij->ij", b["mode_mode_moment"].values))
    np.testing.assert_allclose(found, np.eye(6), atol=1e-9)
    expected = b["mode_mode_moment"].values * np.outer(signs, signs)
    np.testing.assert_allclose(np.abs(a["mode_mode_moment"].values), np.abs(expected), atol=1e-8)


def test_inertia_given_separately_enters_the_mass_alone() -> None:
    """A general section that lends the rod ten times the spin of its area: torsion falls by the root of ten."""
    plain, heavy = rotated(0.0), rotated(0.0)
    heavy["inertia"] = [10.0 * (plain["second_y"] + plain["second_z"]), plain["second_y"], plain["second_z"]]
    a, b = (solve(build(section=s), "free-free", 10) for s in (plain, heavy))
    first = [float(m["frequency"].values[list(m["kind"].values).index("torsion")]) for m in (a, b)]
    assert first[0] / first[1] == pytest.approx(np.sqrt(10.0), rel=1e-9)
    bending = [m["frequency"].values[m["kind"].values == "bending"][:4] for m in (a, b)]
    np.testing.assert_allclose(*bending, rtol=1e-9)


def test_euler_bernoulli_rods_spin_but_do_not_rock() -> None:
    """No rotary inertia in bending, in rigid motion either: inertia across the rod is that of a line of mass."""
    rod = kind.build(RECIPE | {"theory": "euler-bernoulli"})
    data = bundle.build(rod, solve(rod, "free-free", 7))
    second = data["second_moment"].values
    inertia = np.trace(second) * np.eye(3) - second
    mass = float(data["mass"])
    assert inertia[1, 1] == pytest.approx(mass * 0.24**2 / 3.0, rel=1e-12)
    assert inertia[0, 0] == pytest.approx(mass * 0.01**2 / 2.0, rel=1e-12)
    modal_mass = np.einsum("kkij->ij", data["mode_mode_moment"].values)
    np.testing.assert_allclose(modal_mass, np.eye(7), atol=1e-10)


# Wrong recipes: one clear message each, with the place and what to do ------------------------------------------------

CIRCLE = {"type": "circle", "radius": "10 mm"}


def segmented(*cuts: tuple[float, float], **more: Any) -> dict[str, Any]:
    segments = [{"start": a, "end": b, "elements": 3, "section": CIRCLE, **more} for a, b in cuts]
    return {**WITHOUT_SHAPE, "shape": {"type": "segmented-beam", "length": 0.24, "segments": segments}}


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "gap": (
        segmented((0.0, 0.1), (0.12, 0.24)),
        r"\[shape\].*between segment 0 \(0\.1 m\) and segment 1 \(0\.12 m\).*gap",
    ),
    "overlap": (segmented((0.0, 0.13), (0.12, 0.24)), r"\[shape\].*there is an overlap"),
    "too short": (
        segmented((0.0, 0.1), (0.1, 0.2)),
        r"\[shape\].*segment 1 \(0\.2 m\) and the rod's end \(0\.24 m\).*gap",
    ),
    "late start": (segmented((0.02, 0.24)), r"\[shape\].*between the rod \(0 m\) and segment 0 \(0\.02 m\).*gap"),
    "backwards": (segmented((0.24, 0.0)), r"\[shape\.segments\.0\].*must end after its start"),
    "no segments": (segmented(), r"\[shape\].*between the rod \(0 m\) and the rod's end \(0\.24 m\).*gap"),
    "negative area": (RECIPE | {"section": GENERAL | {"area": "-3 mm^2"}}, r"\[section\.area\].*greater than 0"),
    "impossible product": (RECIPE | {"section": GENERAL | {"product": 7e-9}}, r"\[section\].*its square is below"),
    "negative inertia": (
        RECIPE | {"section": GENERAL | {"inertia": [1e-8, -1e-9, 1e-9]}},
        r"\[section\].*cannot be negative",
    ),
    "wall": (
        RECIPE | {"section": {"type": "tube", "radius": "5 mm", "inner_radius": "6 mm"}},
        r"\[section\].*is not below the radius",
    ),
    "no kappa": (
        RECIPE | {"section": GENERAL, "theory": "timoshenko"},
        r"section: a Timoshenko beam needs the shear coefficient.*give shear_coefficient",
    ),
    "no kappa in a segment": (
        segmented((0.0, 0.24), section=GENERAL) | {"theory": "timoshenko"},
        r"\[shape\.segments\.0\.section\]: a Timoshenko beam needs the shear coefficient",
    ),
    "kappa above one": (
        RECIPE | {"section": CIRCLE | {"shear_coefficient": 1.2}},
        r"\[section\.shear_coefficient\].*at most 1",
    ),
    "unknown theory": (RECIPE | {"theory": "reissner"}, r"\[theory\].*'euler-bernoulli', 'rayleigh' or 'timoshenko'"),
    "unknown degree": (RECIPE | {"torsion": "cubic"}, r"\[torsion\].*'linear' or 'quadratic'"),
    "unknown shape": (
        RECIPE | {"shape": {"type": "strait-beam"}},
        r"\[shape\.type\](.|\n)*did you mean 'straight-beam'",
    ),
    "no shape": ({k: v for k, v in RECIPE.items() if k != "shape"}, r"\[shape\.type\]: is missing"),
    "taper of another type": (
        RECIPE | {"end_section": {"type": "rectangle", "width": 0.01, "height": 0.01}},
        r"taper keeps the type of the section; it cannot go from circle to rectangle",
    ),
    "taper of a general section": (RECIPE | {"section": GENERAL, "end_section": GENERAL}, "no dimensions to taper"),
    "kappa said twice": (
        RECIPE | {"end_section": CIRCLE | {"shear_coefficient": 0.9}},
        "give the shear coefficient of a taper once",
    ),
    "mass at no node": (
        RECIPE | {"masses": {"ball": {"x": "67 mm", "mass": 1.0}}},
        r"\[masses\.ball\.x\]: 67 mm lies on no node.*60 mm and 80 mm(.|\n)*move the mass",
    ),
    "negative mass": (
        RECIPE | {"masses": {"ball": {"x": 0.0, "mass": -1.0}}},
        r"\[masses\.ball\.mass\].*greater than 0",
    ),
    "impossible inertia": (
        RECIPE | {"masses": {"ball": {"x": 0.0, "mass": 1.0, "inertia": [1.0, 1.0, 3.0]}}},
        r"\[masses\.ball\.inertia\].*are impossible",
    ),
    "two orientations": (
        RECIPE | {"pose": {"rotation_vector": [0, 0, 1], "quaternion": [1, 0, 0, 0]}},
        r"\[pose\].*give an orientation once",
    ),
    "section next to segments": (segmented((0.0, 0.24)) | {"section": CIRCLE}, r"\[section\]: unknown key"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_recipes_are_refused_in_words(name: str) -> None:
    recipe, message = WRONG[name]
    with pytest.raises(InputError, match=message) as caught:
        kind.build(recipe, where="rod.toml")
    assert caught.value.exit_code == 2
    # one mistake, one message; the hint is a line of its own
    assert len([line for line in str(caught.value).splitlines() if line.startswith("rod.toml")]) == 1
