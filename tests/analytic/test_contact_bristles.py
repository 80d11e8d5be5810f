"""LuGre friction in the engine: a ball that rolls, sticks and slides in its socket on bristles."""

import math

import numpy as np
import pytest

from tests.analytic.mechanism_runs import Overrides, falls_through, require_coulomb, run, tangential_force

ROLLING = "checks/socket_rolling"
CLEARANCE, MASS, GRAVITY = 5e-4, 0.36, 9.81


def at(angle: float, static: float, dynamic: float, end: str) -> Overrides:
    """Let go at rest at an angle [rad] next to the lowest point."""
    law = (
        ("law", "lugre"), ("static", static), ("dynamic", dynamic), ("v_stribeck", 1e-3),
        ("bristle_stiffness", 1e5), ("bristle_damping", 20.0),
    )  # fmt: skip
    reach = CLEARANCE + (MASS * GRAVITY * math.cos(angle) / 1.36306994691e11) ** (2.0 / 3.0)
    place = (reach * math.sin(angle), 0.0, -reach * math.cos(angle))
    return (
        ("joint.contact.friction", law), ("body.ball.pose.position", place), ("time.end", end),
        ("output.interval", "20 us"),
    )  # fmt: skip


GENTLE, STEEP = at(0.1, 0.15, 0.1, "30 ms"), at(1.2, 0.15, 0.1, "10 ms")


@pytest.mark.parametrize("overrides", [GENTLE, STEEP], ids=["rolls", "slides"])
def test_bristles_stay_below_their_limit_only_take_and_close_the_ledger(overrides: Overrides) -> None:
    dataset = run(ROLLING, overrides)
    require_coulomb(dataset)
    swing = float(np.ptp(dataset.potential.values))
    assert np.abs(dataset.energy_error).max() <= 1e-6 * swing
    # the ball rests on its contact, whose energy is there without friction too; the bristles' comes and goes
    assert float(np.ptp(dataset.contact_elastic.values)) > 0.0


def test_on_a_gentle_slope_the_ball_rolls() -> None:
    dataset = run(ROLLING, GENTLE)
    x, time = dataset.position.sel(body="ball", axis="x").values, dataset.time.values
    quarter = falls_through(time, x)[0]
    # 18.8394 Hz at small amplitude (CONTACT-SOCKET-PRELOAD); bristles of 1e5/m give way by 0.03/1e5 of 50 um: 0.6 %
    assert quarter == pytest.approx((1.0 + 0.1**2 / 16.0) / (4.0 * 18.839422771302512), rel=1e-2)


def test_on_a_steep_slope_the_ball_slides_with_the_dynamic_coefficient() -> None:
    dataset = run(ROLLING, STEEP)
    sliding = dataset.contact_sliding_speed.values[:, 0]
    fast = sliding > 1e-2  # ten times v_stribeck: g = mu_d to 1e-43, the damping faded as well
    assert fast.sum() > 20
    normal = dataset.contact_normal_force.values[fast, 0]
    tangential = tangential_force(dataset)[fast, 0]
    # the bristles follow within mu_d / (sigma_0 v) = 0.1 ms of a motion of some milliseconds that turns with the normal
    assert np.median(tangential / normal) == pytest.approx(0.1, rel=2e-2)
    assert "slipping" in dataset.event_kind.values
