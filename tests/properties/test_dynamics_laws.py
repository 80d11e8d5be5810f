"""Contact laws: what every normal law and every friction law must do, whoever adds one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pipeline.core.registry import lookup
from pipeline.core.scene.parts import FrictionLaw, NormalLaw
from pipeline.dynamics.contact import friction, normal
from tests.reference import contact_solutions as exact

Parameters = tuple[float, float, float, float]

#: normal law -> coefficients of restitution to ask for, and its factor a in F = K d^n (1 + a d'/d'0) (closed form)
NORMAL: dict[str, tuple[tuple[float | None, ...], Callable[[float | None], float]]] = {
    "hertz": ((None,), lambda c_r: 0.0),
    "lankarani-nikravesh": ((0.0, 0.5, 0.9, 1.0), lambda c_r: exact.hysteresis(float(c_r or 0.0))),
}
#: the paper's Table 6, and a law without the fall from static to dynamic
FRICTION: dict[str, tuple[FrictionLaw, ...]] = {
    "modified-coulomb": (
        FrictionLaw(law="modified-coulomb", static=0.15, dynamic=0.1, v_static=2e-4, v_dynamic=1e-2),
        FrictionLaw(law="modified-coulomb", static=0.3, dynamic=0.3, v_static=1e-3, v_dynamic=2e-3),
    ),
}


@dataclass(frozen=True)
class Law:
    """A normal law with its numbers; a: factor of its closed forms, None where none is known."""

    name: str
    restitution: float | None
    stiffness: float
    exponent: float

    @property
    def parameters(self) -> Parameters:
        given_law = NormalLaw(law=self.name, restitution=self.restitution, exponent=self.exponent)
        return lookup(normal.__name__, self.name, where="test").parameters(given_law, self.stiffness)

    @property
    def a(self) -> float:
        return NORMAL[self.name][1](self.restitution)

    def force(self, depth: float, rate: float, impact_rate: float) -> float:
        return float(lookup(normal.__name__, self.name, where="test").force(depth, rate, impact_rate, self.parameters))

    def stored(self, depth: float) -> float:
        return float(lookup(normal.__name__, self.name, where="test").stored(depth, self.parameters))


def laws(stiffness: float = 1.3631e11, exponent: float = 1.5) -> list[Law]:
    return [Law(name, c_r, stiffness, exponent) for name, (wanted, _) in NORMAL.items() for c_r in wanted]


def called(value: object) -> str | None:
    return f"{value.name}-{value.restitution}-n{value.exponent}" if isinstance(value, Law) else None


STIFF = st.floats(1e5, 1e12)
EXPONENT = st.one_of(st.just(1.5), st.floats(1.0, 3.0))
DEPTH = st.floats(0.0, 1e-3)
RATE = st.floats(-10.0, 10.0)
IMPACT = st.floats(1e-6, 10.0)
every_law = pytest.mark.parametrize("law", laws(), ids=called)


def test_every_normal_law_is_tried_here() -> None:
    assert set(NORMAL) == set(normal.NAMES)


def test_every_friction_law_is_tried_here() -> None:
    assert set(FRICTION) == set(friction.NAMES)


@every_law
@given(stiffness=STIFF, exponent=EXPONENT, depth=DEPTH, rate=RATE, impact=IMPACT)
def test_normal_force_never_pulls(
    law: Law, stiffness: float, exponent: float, depth: float, rate: float, impact: float
) -> None:
    """However fast the surfaces part, far faster than they met included."""
    assert Law(law.name, law.restitution, stiffness, exponent).force(depth, rate, impact) >= 0.0


@every_law
@given(stiffness=STIFF, exponent=EXPONENT, depth=DEPTH, rate=RATE, impact=IMPACT)
def test_damping_never_feeds_energy(
    law: Law, stiffness: float, exponent: float, depth: float, rate: float, impact: float
) -> None:
    tried = Law(law.name, law.restitution, stiffness, exponent)
    assert (tried.force(depth, rate, impact) - tried.force(depth, 0.0, impact)) * rate >= 0.0


@every_law
@given(stiffness=STIFF, exponent=EXPONENT, depth=st.floats(1e-9, 1e-3), rate=RATE, impact=IMPACT)
def test_normal_force_starts_from_zero_without_a_jump(
    law: Law, stiffness: float, exponent: float, depth: float, rate: float, impact: float
) -> None:
    tried = Law(law.name, law.restitution, stiffness, exponent)
    assert tried.force(0.0, rate, impact) == 0.0
    # d^n with n >= 1 falls at least as fast as d; the factor 1 + 1e-9 is rounding of the power
    assert tried.force(1e-6 * depth, rate, impact) <= 1e-6 * (1.0 + 1e-9) * tried.force(depth, rate, impact)


@every_law
@given(stiffness=STIFF, exponent=EXPONENT, depth=st.floats(1e-9, 1e-3))
def test_stored_energy_is_the_integral_of_the_elastic_force(
    law: Law, stiffness: float, exponent: float, depth: float
) -> None:
    tried = Law(law.name, law.restitution, stiffness, exponent)
    assert tried.stored(0.0) == 0.0
    step = 1e-3 * depth
    # a central difference of fourth order: 1e-12 (n+1)n(n-1)(n-2)(n-3)/30 off, and 1e-16 / 1e-3 of rounding
    near, far = (tried.stored(depth + k * step) - tried.stored(depth - k * step) for k in (1, 2))
    assert (8.0 * near - far) / (12.0 * step) == pytest.approx(tried.force(depth, 0.0, 1.0), rel=1e-11)


@dataclass(frozen=True)
class Impact:
    """A free impact as integrated: rebound over approach speed, largest depth [m], duration [s]."""

    restitution: float
    depth: float
    duration: float


def impact(law: Law, mass: float, speed: float) -> Impact:
    """A mass against the law, time in units of depth over speed so that one tolerance fits all."""
    size = exact.largest_depth(mass, speed, law.stiffness, 0.0, law.exponent)

    def rhs(_: float, y: np.ndarray) -> list[float]:
        force = law.force(max(0.0, y[0]) * size, y[1] * speed, speed)
        return [y[1], -force * size / (mass * speed**2)]

    def left(_: float, y: np.ndarray) -> float:
        return y[0]

    def turned(_: float, y: np.ndarray) -> float:
        return y[1]

    left.terminal, left.direction, turned.direction = True, -1.0, -1.0  # type: ignore[attr-defined]
    done = solve_ivp(rhs, (0.0, 20.0), [0.0, 1.0], "DOP853", events=(left, turned), rtol=1e-12, atol=1e-14)
    assert done.status == 1, "it has not left"
    return Impact(-float(done.y[1, -1]), float(done.y_events[1][0][0]) * size, float(done.t[-1]) * size / speed)


CASES = [(1.3631e11, 1.5, 1.72, 0.05), (1e8, 1.5, 1.0, 0.7), (2e9, 2.2, 0.05, 3.0), (1e5, 1.0, 20.0, 0.01)]


@pytest.mark.parametrize("stiffness, exponent, mass, speed", CASES)
@every_law
def test_free_impact_rebounds_and_penetrates_as_the_closed_form_says(
    law: Law, stiffness: float, exponent: float, mass: float, speed: float
) -> None:
    """ln[(1+a)/(1-ae)] = a(1+e) for any K, n, m and v; depth^(n+1) = (n+1)(m v^2/K)(1/a - ln(1+a)/a^2)."""
    tried = Law(law.name, law.restitution, stiffness, exponent)
    found = impact(tried, mass, speed)
    # rtol 1e-12 over some hundred steps; the force is only once differentiable at the start
    assert found.restitution == pytest.approx(exact.delivered_restitution(tried.a), rel=1e-9)
    assert found.depth == pytest.approx(exact.largest_depth(mass, speed, stiffness, tried.a, exponent), rel=1e-9)


@pytest.mark.parametrize("asked, delivered", [(0.0, 0.663), (0.5, 0.725), (0.7, 0.796), (0.9, 0.913)])
def test_lankarani_nikravesh_delivers_more_than_asked(asked: float, delivered: float) -> None:
    # the known numbers have three digits
    found = impact(Law("lankarani-nikravesh", asked, 1e8, 1.5), 1.0, 0.5)
    assert found.restitution == pytest.approx(delivered, abs=5e-4)


@pytest.mark.parametrize(
    "law", [Law("hertz", None, 1e8, 1.5), Law("lankarani-nikravesh", 1.0, 1e8, 1.5)], ids=lambda law: law.name
)
def test_lossless_hertzian_contact_lasts_2_943275_depths_over_speeds(law: Law) -> None:
    found = impact(law, 0.36, 0.2)
    # the constant is printed with six decimals
    assert found.duration == pytest.approx(2.943275 * found.depth / 0.2, rel=3e-7)


def friction_cases() -> list[FrictionLaw]:
    return [case for cases in FRICTION.values() for case in cases]


def coefficient(law: FrictionLaw, speed: float) -> float:
    part = lookup(friction.__name__, law.law, where="test")
    return float(part.coefficient(speed, part.parameters(law)))


def adams_step(x: float, x0: float, h0: float, x1: float, h1: float) -> float:
    """Wang & Wang (2019), eq. (29)."""
    s = min(max((x - x0) / (x1 - x0), 0.0), 1.0)
    return h0 + (h1 - h0) * s * s * (3.0 - 2.0 * s)


every_friction = pytest.mark.parametrize("law", friction_cases(), ids=lambda law: f"{law.law}-{law.static}")


@every_friction
@given(speed=st.floats(0.0, 1.0), force=st.floats(0.0, 1e5))
def test_friction_stays_below_the_static_limit(law: FrictionLaw, speed: float, force: float) -> None:
    tangential = coefficient(law, speed) * force
    # the polynomials may round past the limit by some last bits
    assert 0.0 <= tangential <= law.static * force * (1.0 + 1e-14)


@every_friction
def test_friction_has_neither_jump_nor_kink_where_its_pieces_meet(law: FrictionLaw) -> None:
    for speed in (law.v_static, law.v_dynamic):
        step = 1e-6 * law.v_static
        here, below, above = (coefficient(law, speed + k * step) for k in (0, -1, 1))
        # flat on both sides: within one step it leaves its value only by curvature, 3 mu_s (1e-6)^2 at most
        assert below == pytest.approx(here, rel=1e-11)
        assert above == pytest.approx(here, rel=1e-11)
    assert coefficient(law, law.v_static) == pytest.approx(law.static, rel=1e-14)
    assert coefficient(law, law.v_dynamic) == pytest.approx(law.dynamic, rel=1e-14)
    assert coefficient(law, 100.0 * law.v_dynamic) == law.dynamic


@every_friction
def test_friction_rises_from_zero_with_one_and_a_half_times_its_mean_slope(law: FrictionLaw) -> None:
    assert coefficient(law, 0.0) == 0.0
    speed = 1e-6 * law.v_static
    # the cubic is y^2 / 3 = 3e-13 below its tangent there
    assert coefficient(law, speed) / speed == pytest.approx(1.5 * law.static / law.v_static, rel=1e-12)


@pytest.mark.parametrize("law", FRICTION["modified-coulomb"], ids=lambda law: str(law.static))
@given(share=st.floats(0.0, 3.0))
def test_friction_coefficient_is_the_papers_steps(law: FrictionLaw, share: float) -> None:
    """Eqs. (27)-(29), one step through zero and one down to mu_d; without the sign that is misprinted."""
    for speed in (share * law.v_static, share * law.v_dynamic):
        if speed < law.v_static:
            known = adams_step(speed, -law.v_static, -law.static, law.v_static, law.static)
        else:
            known = adams_step(speed, law.v_static, law.static, law.v_dynamic, law.dynamic)
        # rounding of s near 1/2, where the first step passes through zero
        assert coefficient(law, speed) == pytest.approx(known, abs=1e-15)
