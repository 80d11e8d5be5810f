"""Normal contact laws: what every one must do, whoever adds one."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from flexclear.dynamics.contact import form as forms
from flexclear.dynamics.contact import normal
from flexclear.dynamics.contact.law import Numbers, Resolved
from flexclear.scene.clearance import NormalLaw

Parameters = tuple[float, float, float, float]

#: normal law -> its factor a in F = K d^n (1 + a d'/d'0) as Machado et al. (2012), Hu & Guo (2015) and Carvalho &
#: Martins (2019) print it, and the coefficients of restitution to ask for
RANGE = (0.05, 0.3, 0.5, 0.7, 0.9, 1.0)
NORMAL: dict[str, tuple[Callable[[float], float], tuple[float | None, ...]]] = {
    "hertz": (lambda c: 0.0, (None,)),
    "hunt-crossley": (lambda c: 3.0 * (1.0 - c) / 2.0, (0.0, *RANGE)),
    "herbert-mcwhannell": (lambda c: 6.0 * (1.0 - c) / ((2.0 * c - 1.0) * (2.0 * c - 1.0) + 3.0), (0.0, *RANGE)),
    "lee-wang": (lambda c: 3.0 * (1.0 - c) / 4.0, (0.0, *RANGE)),
    "lankarani-nikravesh": (lambda c: 3.0 * (1.0 - c * c) / 4.0, (0.0, *RANGE)),
    "gonthier": (lambda c: (1.0 - c * c) / c, RANGE),
    "flores": (lambda c: 8.0 * (1.0 - c) / (5.0 * c), RANGE),
    "hu-guo": (lambda c: 3.0 * (1.0 - c) / (2.0 * c), RANGE),
    "zhiying-qishao": (lambda c: 3.0 * (1.0 - c * c) * math.exp(2.0 - 2.0 * c) / 4.0, (0.0, *RANGE)),
    "carvalho-martins": (lambda c: 3.0 * (1.0 - c) * (11.0 - c) / (2.0 * (1.0 + 9.0 * c)), (0.0, *RANGE)),
    "kelvin-voigt": (lambda c: 0.0, RANGE),
}
MASS = 1.3


def normal_law(**keys: Any) -> Any:
    """A normal law from its keys in a scene."""
    return TypeAdapter(NormalLaw).validate_python(keys)


@dataclass(frozen=True)
class Law:
    """A normal law with its numbers."""

    name: str
    restitution: float | None
    stiffness: float
    exponent: float
    asked: str = "restitution"
    mass: float = MASS

    @cached_property
    def resolved(self) -> Resolved:
        asked = {} if self.restitution is None else {self.asked: self.restitution}
        exponent = {} if self.name == "kelvin-voigt" else {"exponent": self.exponent}
        given_law = normal_law(law=self.name, **exponent, **asked)
        return normal.NORMAL_LAWS[self.name](given_law, self.stiffness, self.mass)

    @property
    def a(self) -> float:
        return NORMAL[self.name][0](float(self.restitution or 0.0))

    def parts(self, depth: float, rate: float, impact_rate: float) -> tuple[float, float]:
        form = forms.FORMS[self.resolved.form]
        elastic, damping = form.force(depth, rate, impact_rate, self.resolved.numbers)
        return float(elastic), float(damping)

    def force(self, depth: float, rate: float, impact_rate: float) -> float:
        return sum(self.parts(depth, rate, impact_rate))

    def stored(self, depth: float) -> float:
        form = forms.FORMS[self.resolved.form]
        return float(form.stored(depth, self.resolved.numbers))


#: more examples than usual, since they try all coefficients of restitution of a law
every_law = pytest.mark.parametrize("name", NORMAL)
many = settings(max_examples=300)
#: a coefficient of restitution by its number, of as many as a law has
CHOICE = st.integers(0, len(RANGE))
STIFF = st.floats(1e5, 1e12)
EXPONENT = st.one_of(st.just(1.5), st.floats(1.0, 3.0))
DEPTH = st.floats(0.0, 1e-3)
RATE = st.floats(-10.0, 10.0)
IMPACT = st.floats(1e-6, 10.0)


def law(name: str, choice: int, stiffness: float, exponent: float) -> Law:
    requested = NORMAL[name][1]
    return Law(name, requested[choice % len(requested)], stiffness, exponent)


def test_every_normal_law_is_tried_here() -> None:
    assert set(NORMAL) == set(normal.NORMAL_LAWS)


@pytest.mark.parametrize("form", ["elastic", "hysteretic", "linear-damper"])
@given(stiffness=STIFF, exponent=EXPONENT, depth=st.floats(1e-9, 1e-3))
def test_every_form_has_the_inverse_of_its_elastic_force(
    form: str, stiffness: float, exponent: float, depth: float
) -> None:
    numbers = Numbers(stiffness, 1.0 if form == "linear-damper" else exponent, 0.3)
    elastic, _ = forms.FORMS[form].force(depth, 0.0, 1.0, numbers)
    found = Resolved(form, numbers, None, 1.0).depth(elastic)
    assert found == pytest.approx(depth, rel=1e-13)  # two powers, of logarithms up to 21 with rounding
    assert Resolved(form, numbers, None, 1.0).depth(0.0) == 0.0


@every_law
@many
@given(choice=CHOICE, stiffness=STIFF, exponent=EXPONENT, depth=DEPTH, rate=RATE, impact=IMPACT)
def test_normal_force_never_pulls_and_damping_never_feeds_energy(
    name: str, choice: int, stiffness: float, exponent: float, depth: float, rate: float, impact: float
) -> None:
    """However fast the surfaces part, far faster than they met included."""
    elastic, damping = law(name, choice, stiffness, exponent).parts(depth, rate, impact)
    assert damping >= -elastic
    assert damping * rate >= 0.0


@pytest.mark.parametrize("name", [name for name in NORMAL if name != "kelvin-voigt"])
@many
@given(choice=CHOICE, stiffness=STIFF, exponent=EXPONENT, depth=st.floats(1e-9, 1e-3), rate=RATE, impact=IMPACT)
def test_normal_force_starts_from_zero_without_a_jump(
    name: str, choice: int, stiffness: float, exponent: float, depth: float, rate: float, impact: float
) -> None:
    tried = law(name, choice, stiffness, exponent)
    assert tried.force(0.0, rate, impact) == 0.0
    # d^n with n >= 1 falls at least as fast as d; the factor 1 + 1e-9 is rounding of the power
    assert tried.force(1e-6 * depth, rate, impact) <= 1e-6 * (1.0 + 1e-9) * tried.force(depth, rate, impact)


@every_law
@many
@given(choice=CHOICE, stiffness=STIFF, exponent=EXPONENT, depth=st.floats(1e-9, 1e-3))
def test_stored_energy_is_the_integral_of_the_elastic_force(
    name: str, choice: int, stiffness: float, exponent: float, depth: float
) -> None:
    tried = law(name, choice, stiffness, exponent)
    assert tried.stored(0.0) == 0.0
    step = 1e-3 * depth
    # a central difference of fourth order: 1e-12 (n+1)n(n-1)(n-2)(n-3)/30 off, and 1e-16 / 1e-3 of rounding
    near, far = (tried.stored(depth + k * step) - tried.stored(depth - k * step) for k in (1, 2))
    assert (8.0 * near - far) / (12.0 * step) == pytest.approx(tried.force(depth, 0.0, 1.0), rel=1e-11)


@pytest.mark.parametrize(
    "name",
    ["hunt-crossley", "herbert-mcwhannell", "lee-wang", "lankarani-nikravesh", "zhiying-qishao", "carvalho-martins"],
)
def test_the_range_that_a_warning_names_is_that_of_restitutions_delivered_within_a_twentieth(name: str) -> None:
    warning = Law(name, 0.002, 1e9, 1.5).resolved.warning
    assert warning is not None
    low = float(warning.partition("meant for ")[2].split()[0])
    for requested, agrees in ((low, True), (low - 0.01, False)):
        resolved = Law(name, requested, 1e9, 1.5).resolved
        assert (abs(float(resolved.delivered or 0.0) - requested) <= 0.05) == agrees
        assert (resolved.warning is None) == agrees
