"""Closed forms of contact against quadrature and one-dimensional integration, without any engine."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import solve_ivp

from tests.reference import contact_solutions as exact
from tests.reference import sps4
from tests.reference.clearance_contact import friction_coefficient


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("exponent", [1.5, 2.0])
def test_free_impact_follows_the_closed_forms(restitution: float, exponent: float) -> None:
    mass, speed, stiffness, a = 0.7, 0.3, 1e9, exact.hysteresis(restitution)
    deep = exact.largest_depth(mass, speed, stiffness, a, exponent)

    def rhs(_: float, y: list[float]) -> list[float]:
        # depth in units of the largest one, time in units of depth over speed
        push = stiffness * deep ** (exponent + 1.0) / (mass * speed**2)
        return [y[1], -push * max(0.0, y[0]) ** exponent * (1.0 + a * y[1])]

    def left(_: float, y: list[float]) -> float:
        return y[0]

    def turned(_: float, y: list[float]) -> float:
        return y[1]

    left.terminal, left.direction = True, -1.0  # type: ignore[attr-defined]
    run = solve_ivp(
        rhs, (0.0, 100.0), [0.0, 1.0], "DOP853", events=(left, turned), rtol=1e-12, atol=1e-14, max_step=0.01
    )
    # integration at 1e-12
    assert -run.y[1, -1] == pytest.approx(exact.delivered_restitution(a), abs=1e-9)
    assert run.y_events[1][0][0] == pytest.approx(1.0, abs=1e-9)
    if a == 0.0:
        assert run.t[-1] == pytest.approx(exact.hertz_time(mass, speed, stiffness, exponent) * speed / deep, rel=1e-9)


def test_delivered_restitution_is_more_than_asked_for() -> None:
    """The law is meant for values near 1; these are what it gives for 0, 0.5, 0.7 and 0.9."""
    delivered = [exact.delivered_restitution(exact.hysteresis(e)) for e in (0.0, 0.5, 0.7, 0.9)]
    assert delivered == pytest.approx([0.663, 0.725, 0.796, 0.913], abs=5e-4)


def test_lossless_contact_time_is_hertzs() -> None:
    depth = exact.largest_depth(0.36, 0.1, 1.3631e11, 0.0)
    assert exact.hertz_time(0.36, 0.1, 1.3631e11) == pytest.approx(2.943275 * depth / 0.1, rel=1e-6)


def test_stiffness_of_the_papers_contact() -> None:
    assert sps4.Contact().stiffness == pytest.approx(1.3631e11, rel=1e-4)


def test_friction_rises_to_static_and_falls_to_dynamic() -> None:
    c = sps4.Contact()
    assert friction_coefficient(c, 0.0) == 0.0
    assert friction_coefficient(c, c.v_static) == pytest.approx(c.mu_static, rel=1e-14)
    assert friction_coefficient(c, c.v_dynamic) == pytest.approx(c.mu_dynamic, rel=1e-14)
    slope = friction_coefficient(c, 1e-9) / 1e-9
    assert slope == pytest.approx(1.5 * c.mu_static / c.v_static, rel=1e-8)


def test_conical_steady_state_balances() -> None:
    c = exact.conical(0.36, 1.3631e11, 0.5e-3, 9.81, 0.6)
    assert c.force * math.sin(0.6) == pytest.approx(0.36 * c.rate**2 * c.radius, rel=1e-12)
    assert c.force == pytest.approx(1.3631e11 * c.depth**1.5, rel=1e-12)
