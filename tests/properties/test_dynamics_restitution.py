"""Every normal law in a free impact: delivered restitution, largest penetration, duration, against closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flexclear.dynamics.contact import normal, restitution
from flexclear.dynamics.contact.normal import kelvin_voigt
from tests.properties.test_dynamics_laws import NORMAL, Law, normal_law
from tests.reference import contact_solutions as exact

#: laws that cover the range of a free choice of the rebound
HYSTERETIC = sorted(set(NORMAL) - {"hertz", "kelvin-voigt"})


#: every law with each coefficient of restitution that it is asked for
LAWS = [Law(name, c_r, 1.3631e11, 1.5) for name, (_, requested) in NORMAL.items() for c_r in requested]


@dataclass(frozen=True)
class Impact:
    """A free impact as integrated: rebound over approach speed, largest depth [m], duration [s]."""

    restitution: float
    depth: float
    duration: float


def impact(law: Law, speed: float) -> Impact:
    """A mass against the law, time in units of depth over speed so that one tolerance fits all.

    It ends where the surfaces part, or where the force does, which then stays away.
    """
    exponent = law.resolved.numbers.exponent
    size = exact.largest_depth(law.mass, speed, law.stiffness, 0.0, exponent)

    def rhs(_: float, y: np.ndarray) -> list[float]:
        force = law.force(max(0.0, y[0]) * size, y[1] * speed, speed)
        return [y[1], -force * size / (law.mass * speed**2)]

    def left(_: float, y: np.ndarray) -> float:
        pull = sum(law.parts(max(0.0, y[0]) * size, y[1] * speed, speed)) if y[1] < 0.0 else 1.0
        return y[0] if pull > 0.0 else -1.0

    def turned(_: float, y: np.ndarray) -> float:
        return y[1]

    left.terminal, left.direction, turned.direction = True, -1.0, -1.0  # type: ignore[attr-defined]
    done = solve_ivp(rhs, (0.0, 200.0), [0.0, 1.0], "DOP853", events=(left, turned), rtol=1e-12, atol=1e-14)
    assert done.status == 1, "it has not left"
    return Impact(-float(done.y[1, -1]), float(done.y_events[1][0][0]) * size, float(done.t[-1]) * size / speed)


def ratio(law: Law) -> float:
    """Damping ratio of a linear law."""
    numbers = law.resolved.numbers
    return numbers.damping / (2.0 * math.sqrt(numbers.stiffness * law.mass))


def known_depth(law: Law, speed: float) -> float:
    if law.name == "kelvin-voigt":
        # v = 0 at w t = pi/2 - phi: depth = (v/w0) exp(-tan(phi) (pi/2 - phi)), phi = asin(zeta)
        phi = math.asin(ratio(law))
        return speed * math.sqrt(law.mass / law.stiffness) * math.exp(-math.tan(phi) * (math.pi / 2.0 - phi))
    return exact.largest_depth(
        law.mass, speed, law.stiffness, law.resolved.numbers.damping, law.resolved.numbers.exponent
    )


def known_restitution(law: Law) -> float:
    if law.name == "kelvin-voigt":
        # F = 0 at w t = pi - 2 phi; the speed is then -exp(-tan(phi) (pi - 2 phi))
        phi = math.asin(ratio(law))
        return math.exp(-math.tan(phi) * (math.pi - 2.0 * phi))
    return exact.delivered_restitution(law.resolved.numbers.damping)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.name}-{law.restitution}")
def test_factor_is_the_published_one(law: Law) -> None:
    if law.name != "kelvin-voigt":
        assert law.resolved.numbers.damping == pytest.approx(law.a, rel=1e-14)


@pytest.mark.parametrize("name", NORMAL)
@given(
    stiffness=st.floats(5.0, 12.0).map(lambda x: 10.0**x),
    exponent=st.floats(1.0, 3.0),
    mass=st.floats(-3.0, 3.0).map(lambda x: 10.0**x),
    speed=st.floats(-3.0, 1.0).map(lambda x: 10.0**x),
    asked=st.floats(0.3, 1.0),
)
@settings(max_examples=6)
def test_free_impact_rebounds_and_penetrates_as_the_closed_form_says(
    name: str, stiffness: float, exponent: float, mass: float, speed: float, asked: float
) -> None:
    law = Law(name, None if name == "hertz" else asked, stiffness, exponent, mass=mass)
    found = impact(law, speed)
    # rtol 1e-12 over some hundred steps; the force is only once differentiable at the start
    assert found.restitution == pytest.approx(known_restitution(law), rel=1e-8)
    assert found.restitution == pytest.approx(law.resolved.delivered, rel=1e-8)
    assert found.depth == pytest.approx(known_depth(law, speed), rel=1e-8)


@given(e=st.floats(1e-4, 0.06))
def test_a_nearly_plastic_impact_has_the_factor_of_its_closed_form(e: float) -> None:
    """1 - a e = exp(-a e - a) (1 + a), which is ln[(1 + a)/(1 - a e)] = a (1 + e): below e = 0.03 it is rounding."""
    a = restitution.factor(e)
    assert 1.0 - a * e == pytest.approx(math.exp(-a * e - a) * (1.0 + a), abs=1e-15)
    assert restitution.delivered(a) == pytest.approx(e, rel=1e-15)


@pytest.mark.parametrize("name", HYSTERETIC)
@given(asked=st.floats(0.7, 1.0))
@settings(max_examples=10)
def test_delivered_restitution_is_delivered(name: str, asked: float) -> None:
    law = Law(name, asked, 1e9, 1.5, asked="delivered_restitution")
    # the closed form has no other errors than rounding
    assert exact.delivered_restitution(law.resolved.numbers.damping) == pytest.approx(asked, rel=1e-9)
    parameter = law.resolved.parameter
    assert parameter is not None
    # the parameter that is reported gives the same factor when it is asked for
    assert NORMAL[name][0](parameter) == pytest.approx(law.resolved.numbers.damping, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("asked", [0.01, 0.1, 0.5, 0.99])
def test_linear_law_delivers_what_it_is_asked_for(asked: float) -> None:
    found = impact(Law("kelvin-voigt", asked, 1e7, 1.0), 0.4)
    # the clipped force has a kink at its end, where the integration stops
    assert found.restitution == pytest.approx(asked, rel=1e-7)


def test_linear_law_above_critical_damping_is_the_limit_of_the_formula_below() -> None:
    below, above = (restitution.linear_delivered(1.0 + k * 1e-7) for k in (-1, 1))
    # the slope of ln e there is of order one
    assert below == pytest.approx(math.exp(-2.0), rel=1e-6)
    assert above == pytest.approx(math.exp(-2.0), rel=1e-6)


@pytest.mark.parametrize("asked, delivered", [(0.0, 0.663), (0.5, 0.725), (0.7, 0.796), (0.9, 0.913)])
def test_lankarani_nikravesh_delivers_more_than_asked(asked: float, delivered: float) -> None:
    # the known numbers have three digits
    assert impact(Law("lankarani-nikravesh", asked, 1e8, 1.5), 0.5).restitution == pytest.approx(delivered, abs=5e-4)


@pytest.mark.parametrize("name", ["hertz", *HYSTERETIC])
def test_lossless_hertzian_contact_lasts_2_943275_depths_over_speeds(name: str) -> None:
    found = impact(Law(name, None if name == "hertz" else 1.0, 1e8, 1.5), 0.2)
    # the constant is printed with six decimals
    assert found.duration == pytest.approx(2.943275 * found.depth / 0.2, rel=3e-7)


@pytest.mark.parametrize("name", HYSTERETIC)
def test_warning_where_a_law_does_not_deliver_what_it_is_asked_for(name: str) -> None:
    asked = [c / 100.0 for c in range(2, 100)]
    for c in asked:
        resolved = Law(name, c, 1e8, 1.5).resolved
        # by 0.05, as the warning says
        assert (resolved.warning is not None) == (abs(resolved.delivered - c) > 0.05), c


@pytest.mark.parametrize(
    "law, said",
    [
        ({"law": "hertz", "delivered_restitution": 0.5}, "has no loss"),
        ({"law": "hertz", "damping": 1.0}, "damping"),
        ({"law": "lankarani-nikravesh"}, "needs a restitution"),
        ({"law": "lankarani-nikravesh", "delivered_restitution": 0.5}, "no restitution below 0.66"),
        ({"law": "lankarani-nikravesh", "delivered_restitution": 0.0}, "no finite damping"),
        ({"law": "lankarani-nikravesh", "restitution": 0.9, "damping": 1.0}, "damping"),
        ({"law": "kelvin-voigt", "restitution": 0.5, "exponent": 1.5}, "exponent"),
        ({"law": "kelvin-voigt"}, "needs a damping"),
        ({"law": "kelvin-voigt", "damping": 1.0, "restitution": 0.5}, "are alternatives"),
        ({"law": "kelvin-voigt", "restitution": 0.0}, "no finite damping"),
    ],
)
def test_what_a_law_cannot_do_is_refused_in_words(law: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        normal.NORMAL_LAWS[law["law"]](normal_law(**law), 1e9, 1.0)


def test_a_linear_damper_asks_for_a_mass_where_a_restitution_needs_one() -> None:
    given = normal_law(law="kelvin-voigt", damping=20.0)
    assert kelvin_voigt.resolve(given, 1e4, None).delivered is None
    assert kelvin_voigt.resolve(given, 1e4, 1.0).numbers == kelvin_voigt.resolve(given, 1e4, None).numbers
    with pytest.raises(ValueError, match="no mass is known"):
        kelvin_voigt.resolve(normal_law(law="kelvin-voigt", restitution=0.5), 1e4, None)
