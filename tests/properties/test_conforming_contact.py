"""Elastic forces of tight fits: against their formulas, Hertz's and the pressure of a layer, integrated."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from scipy.integrate import quad
from scipy.optimize import brentq

from flexclear.dynamics.contact.form import FORMS
from flexclear.dynamics.contact.form.logarithmic import LIMIT_DEPTH
from flexclear.dynamics.contact.law import Resolved
from flexclear.dynamics.contact.validity import warnings
from flexclear.dynamics.model.contacts import resolve_law
from flexclear.scene.clearance import NormalLaw
from flexclear.scene.ends import Stop
from flexclear.scene.loose_joints import Clearance
from flexclear.system.errors import InputError
from tests.properties.kernels import from_python

STEEL, BRONZE = {"youngs_modulus": "207 GPa", "poisson": 0.3}, {"youngs_modulus": "110 GPa", "poisson": 0.34}
E_STAR = 1.0 / ((1.0 - 0.3**2) / 207e9 + (1.0 - 0.34**2) / 110e9)
RADIUS, LENGTH, LAYER = 9.5e-3, 15e-3, {"modulus": "1 GPa", "thickness": "0.5 mm"}
LOGARITHMIC = ("johnson", "radzimovsky", "goldsmith", "esdu-78035")
FORMS_OF_PINS = (*LOGARITHMIC, "liu", "pereira", "winkler")


def joint(form: str, clearance: float = 1e-4, kind: str = "clearance-revolute", **law: Any) -> Any:
    outer, inner = {
        "clearance-revolute": ("journal", "pin"),
        "clearance-slot": ("slot", "pin"),
        "clearance-spherical": ("socket", "ball"),
        "ball-on-plane": ("plane", "ball"),
    }[kind]
    keys: dict[str, Any] = {"type": kind, "between": ["ground.O", "pin.P"], f"{inner}_radius": RADIUS}
    keys |= {"clearance": clearance} if kind != "ball-on-plane" else {}
    keys |= {"length": LENGTH} if inner == "pin" else {}
    keys |= {"travel": "20 mm"} if kind == "clearance-slot" else {}
    keys |= {f"{outer}_material": BRONZE, f"{inner}_material": STEEL}
    normal = {"law": "hertz", "form": form, **({"layer": LAYER} if form == "winkler" else {}), **law}
    return TypeAdapter(Clearance).validate_python(keys | {"normal": normal})


def resolved(form: str, clearance: float = 1e-4, kind: str = "clearance-revolute", **law: Any) -> Resolved:
    return resolve_law(joint(form, clearance, kind, **law), 1.0, "[joint.J.normal]")


def force(law: Resolved, depth: float) -> float:
    return float(sum(from_python(FORMS[law.form].force)(depth, 0.0, 1.0, law.numbers)))


def compression(form: str, force: float, clearance: float) -> float:
    """The implicit formulas as they are printed."""
    per_length, compliance = force / LENGTH, 1.0 / (math.pi * E_STAR)
    outer, inner = RADIUS + clearance, RADIUS
    if form == "radzimovsky":
        b = 1.6 * math.sqrt(per_length * 2.0 * outer * inner / clearance / E_STAR)
        bracket = 2.0 / 3.0 + math.log(4.0 * outer / b) + math.log(4.0 * inner / b)
    elif form == "goldsmith":
        bracket = math.log(LENGTH**3 * clearance / (force * outer * inner * compliance)) + 1.0
    else:
        constant = -1.0 if form == "johnson" else 1.0
        bracket = math.log(4.0 * math.pi * E_STAR * clearance / per_length) + constant
    return per_length * compliance * bracket


@pytest.mark.parametrize("form", LOGARITHMIC)
@pytest.mark.parametrize("clearance", [5e-6, 1e-4, 2e-3])
def test_a_logarithmic_force_solves_its_formula_to_rounding(form: str, clearance: float) -> None:
    law = resolved(form, clearance)
    for share in (1e-9, 1e-5, 1e-3, 0.03, 0.3, 0.8, 1.0):
        depth = share * law.deepest
        found = force(law, depth)
        assert compression(form, found, clearance) == pytest.approx(depth, rel=1e-12)
        assert law.depth(found) == pytest.approx(depth, rel=1e-12)
        # the root of the formula below its largest compression, by another method
        top = law.numbers.values[0]
        other = brentq(
            lambda F, d=depth: compression(form, F, clearance) - d, 1e-14 * top, top, xtol=1e-300, rtol=1e-14
        )
        assert found == pytest.approx(other, rel=1e-11)  # near the limit the slope multiplies rounding by up to 1.4


@pytest.mark.parametrize("form", LOGARITHMIC)
def test_a_logarithmic_force_goes_on_along_its_tangent(form: str) -> None:
    law = resolved(form)
    assert law.deepest == pytest.approx(LIMIT_DEPTH * law.numbers.values[1])
    slopes = [(force(law, law.deepest * (1.0 + s)) - force(law, law.deepest)) / s for s in (-1e-6, 1e-6, 1.0)]
    assert slopes == pytest.approx(slopes[2:] * 3, rel=1e-5)  # from below by the formula, whose curvature is 1e-6
    assert law.depth(force(law, 3.0 * law.deepest)) == pytest.approx(3.0 * law.deepest, rel=1e-13)


def test_johnsons_formula_is_the_compression_by_hertzs_pressure_of_both_cylinders() -> None:
    """Johnson (1985), eq. (5.58): a cylinder of radius R under Hertz's pressure of half-width a is compressed by
    F'(1-nu^2)/(pi E)(2 ln(4R/a) - 1) between its axis and the contact; for equal materials both add up."""
    clearance, per_length = 1e-3, 5e5
    own = 1.0 / (2.0 * E_STAR)  # (1 - nu^2)/E of two equal bodies with this E*
    a = math.sqrt(4.0 * per_length * RADIUS * (RADIUS + clearance) / clearance / (math.pi * E_STAR))
    both = sum(per_length * own / math.pi * (2.0 * math.log(4.0 * R / a) - 1.0) for R in (RADIUS, RADIUS + clearance))
    assert force(resolved("johnson", clearance), both) == pytest.approx(per_length * LENGTH, rel=1e-12)


def test_radzimovskys_formula_is_near_johnsons() -> None:
    """Its width is Hertz's to 0.3 %, its constant 2/3 - 2 ln(1.6/sqrt(pi/2)...) differs from Johnson's by 0.29."""
    law, other = resolved("radzimovsky", 1e-3), resolved("johnson", 1e-3)
    # delta pi E* L / F of both: [2/3 + ln(16/(2 1.6^2))] - [ln(4 pi) - 1]
    differ = 2.0 / 3.0 + math.log(16.0 / (2.0 * 1.6**2)) - math.log(4.0 * math.pi) + 1.0
    F = 1e3
    assert differ == pytest.approx(0.275, abs=1e-3)
    assert (law.depth(F) - other.depth(F)) * math.pi * E_STAR * LENGTH / F == pytest.approx(differ, rel=1e-9)


def test_lius_force_is_its_formula() -> None:
    depth, clearance = 3e-5, 1e-4
    expected = 0.5 * math.pi * E_STAR * LENGTH * depth * math.sqrt(depth / (2.0 * (clearance + depth)))
    assert force(resolved("liu", clearance), depth) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("clearance", [5e-6, 5e-5, 3.4e-4, 3.5e-4, 5e-3])
def test_pereiras_force_is_its_fit_in_millimetres(clearance: float) -> None:
    c, depth, modulus = 1e3 * clearance, 0.02, E_STAR / 1e6
    Y = 1.51 * math.log(1000.0 * c) ** -0.151 if c < 0.34954 else 0.0151 * c + 1.151
    expected = (0.965 * c + 0.0965) * 1e3 * LENGTH * modulus / c * depth ** (Y * c**-0.005)
    assert force(resolved("pereira", clearance), 1e-3 * depth) == pytest.approx(expected, rel=1e-12)


def test_pereiras_fit_is_near_johnsons_formula() -> None:
    """Its authors fitted it to Johnson's model; the fit's own error is some 20 % in the middle of its range."""
    tight, other = resolved("pereira", 5e-4), resolved("johnson", 5e-4)
    for depth in (5e-6, 2e-5, 1e-4):
        assert force(tight, depth) == pytest.approx(force(other, depth), rel=0.3)


@pytest.mark.parametrize("depth", [1e-9, 1e-6, 3e-5, 1e-3])
@pytest.mark.parametrize("kind", ["clearance-revolute", "clearance-spherical"])
def test_a_layers_force_is_the_integral_of_its_pressure(kind: str, depth: float) -> None:
    clearance, bed = 1e-4, 1e9 / 5e-4
    edge = 2.0 * math.asin(math.sqrt(0.5 * depth / (clearance + depth)))

    def pressed(x: float) -> float:
        compressed = depth - 2.0 * (clearance + depth) * math.sin(0.5 * x) ** 2
        ring = 2.0 * LENGTH * RADIUS if kind == "clearance-revolute" else 2.0 * math.pi * RADIUS**2 * math.sin(x)
        return bed * compressed * math.cos(x) * ring

    expected = quad(pressed, 0.0, edge, epsrel=1e-12, epsabs=0.0)[0]
    assert force(resolved("winkler", clearance, kind), depth) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "kind, expected",
    [
        ("clearance-revolute", lambda R, d: 4.0 / 3.0 * LENGTH * math.sqrt(2.0 * R) * d**1.5),
        ("clearance-slot", lambda R, d: 4.0 / 3.0 * LENGTH * math.sqrt(2.0 * RADIUS) * d**1.5),
        ("clearance-spherical", lambda R, d: math.pi * R * d**2),
        ("ball-on-plane", lambda R, d: math.pi * RADIUS * d**2),
    ],
)
def test_a_layer_in_an_open_joint_is_pressed_by_a_parabola(kind: str, expected: Any) -> None:
    """R of the open joint: that of a parabola with the curvature of the gap, R^2/c."""
    depth, clearance = 1e-8, 1e-3
    bed = 1e9 / 5e-4 * expected(RADIUS**2 / clearance, depth)
    assert force(resolved("winkler", clearance, kind), depth) == pytest.approx(bed, rel=2.0 * depth / clearance)


@pytest.mark.parametrize("form", FORMS_OF_PINS)
@pytest.mark.parametrize("share", [1e-6, 0.1, 0.99, 2.0])
def test_the_stored_energy_is_the_integral_of_the_force(form: str, share: float) -> None:
    law = resolved(form)
    depth = share * min(law.deepest, 1e-4)
    step = 1e-3 * depth
    stored = from_python(FORMS[law.form].stored)
    near, far = (stored(depth + k * step, law.numbers) - stored(depth - k * step, law.numbers) for k in (1, 2))
    # of order four; rounding 1e-16/1e-3, and 1e-11 of the curvature near the logarithm's limit
    assert (8.0 * near - far) / (12.0 * step) == pytest.approx(force(law, depth), rel=1e-10)
    assert stored(0.0, law.numbers) == 0.0


@pytest.mark.parametrize("form", FORMS_OF_PINS)
def test_a_tight_fit_has_the_damping_of_its_law(form: str) -> None:
    law = resolved(form, law="flores", restitution=0.7)
    elastic, damping = from_python(FORMS[law.form].force)(2e-5, 0.3, 0.5, law.numbers)
    assert damping == pytest.approx(elastic * 1.6 * 0.3 / 0.7 * 0.6, rel=1e-13)  # 8(1-c)/(5c) times rate/impact_rate
    assert law.delivered == pytest.approx(resolved("liu", law="flores", restitution=0.7).delivered)
    parting = from_python(FORMS[law.form].force)(2e-5, -9.0, 0.5, law.numbers)
    assert sum(parting) == 0.0


def test_a_contact_too_wide_for_hertz_is_told_the_form_that_holds() -> None:
    one = TypeAdapter(Clearance).validate_python(
        joint("liu").model_dump(mode="json", exclude_none=True) | {"normal": {"law": "hertz"}}
    )
    law = resolve_law(one, 1.0, "")
    for depth, form in ((3e-5, "johnson"), (2e-4, "pereira")):
        found = warnings("joint J", one, law, depth, 1e6)
        assert "Hertz" in found[0]
        assert f"normal.form = '{form}'" in found[0]
    assert not warnings("joint J", joint("johnson"), resolved("johnson"), 3e-5, 1e6)
    (beyond,) = warnings("joint J", joint("johnson"), resolved("johnson"), 6e-5, 1e6)
    assert "form 'johnson' holds to 4.58e-05 m" in beyond
    assert "normal.form = 'pereira'" in beyond


@pytest.mark.parametrize(
    "made, words",
    [
        (lambda: resolved("johnson", kind="clearance-spherical"), "pin in a round journal"),
        (lambda: resolved("liu", kind="clearance-slot"), "pin in a round journal"),
        (lambda: resolved("pereira", 2e-6), "0.005 to 10 mm, not to 0.002 mm"),
        (lambda: joint("johnson", stiffness=1e9), "own stiffness"),
        (lambda: joint("johnson", exponent=1.2), "own stiffness"),
        (lambda: joint("winkler", layer=None), "belong together"),
        (lambda: joint("liu", layer=LAYER), "belong together"),
        (
            lambda: Stop(
                joint="A", lower=0.0, normal=TypeAdapter(NormalLaw).validate_python(dict(law="hertz", form="liu"))
            ),
            "a stop has no radii",
        ),
    ],
)
def test_impossible_tight_fits_are_refused_in_words(made: Any, words: str) -> None:
    with pytest.raises((InputError, ValidationError), match=words):
        made()


def test_the_forms_of_the_scene_are_those_of_the_program() -> None:
    from flexclear.dynamics.contact.conforming import CONFORMING

    schema = json.dumps(TypeAdapter(NormalLaw).json_schema())
    assert all(f'"{form}"' in schema for form in CONFORMING)
    assert set(FORMS_OF_PINS) == set(CONFORMING)
    assert np.isfinite([force(resolved(form), 1e-5) for form in CONFORMING]).all()
