"""A ball in its socket, pressed, rolling, circling, on bristles, against closed forms."""

import math

import numpy as np
import pytest

from tests.analytic.mechanism_runs import Overrides, falls_through, require_coulomb, run, tangential_force
from tests.reference import sps4

PRELOAD, ROLLING = "checks/socket_preload", "checks/socket_rolling"
KNOWN = {"resting depth": 8.755929250633222e-08, "vertical": 2063.23712159149, "rolling": 18.839422771302512}
#: amplitude [rad] -> time from rest to the lowest point [s]
QUARTER_PERIOD = {0.1: 0.011222258061509125, 0.5: 0.011393241546617099, 1.0: 0.01195997337207989}
#: half angle [rad] -> depth, radius, height [m], speed [m/s], normal force [N]
CONICAL = {
    0.2: (8.874254053876619e-08, 9.93522958186726e-05, -0.0004901202625186361, 0.014055978433541758, 3.603428664794316),
    0.6: (9.951346604407635e-08, 0.00028237742622712114, -0.0004127499394625288, 0.043533237887315, 4.278986555531698),
}
MASS, GRAVITY = 0.36, 9.81
CONTACT = sps4.Contact()


def test_a_pressed_ball_starts_in_contact_and_vibrates_at_its_frequency() -> None:
    """The start is noted as the closing."""
    dataset = run(PRELOAD)
    assert dataset.event_kind[0] == "closing"
    assert float(dataset.event_time[0]) == 0.0
    assert float(dataset.event_approach_speed[0]) == 1e-6
    # ten vibrations, each with one deepest point, and no other event
    deepest = dataset.event_kind.values == "compression"
    assert deepest.sum() == 10
    assert len(deepest) == 11
    # after a whole period the start's depth is back: located to the tolerance of the run
    back = dataset.event_peak_penetration.values[deepest]
    assert back == pytest.approx(1.001 * KNOWN["resting depth"], rel=1e-8)
    # an amplitude of 1e-3 changes the frequency by less than 1e-6
    assert np.diff(dataset.event_time.values[deepest]) == pytest.approx(1.0 / KNOWN["vertical"], rel=1e-6)


@pytest.mark.parametrize("amplitude", QUARTER_PERIOD)
def test_swing_reaches_the_lowest_point_in_a_quarter_of_its_period(amplitude: float) -> None:
    depth = (MASS * GRAVITY * math.cos(amplitude) / CONTACT.stiffness) ** (2.0 / 3.0)
    reach = CONTACT.clearance + depth
    place = (reach * math.sin(amplitude), 0.0, -reach * math.cos(amplitude))
    dataset = run(PRELOAD, (("body.ball.pose.position", place), ("time.end", "15 ms"), ("output.interval", "5 us")))
    found = falls_through(dataset.time.values, dataset.position.sel(body="ball", axis="x").values)[0]
    # the contact's own vibration, set going by the change of weight on the way, differs with the start
    assert found == pytest.approx(QUARTER_PERIOD[amplitude], rel=1e-5)


@pytest.mark.parametrize("angle", CONICAL)
def test_ball_circles_steadily(angle: float) -> None:
    _, radius, height, speed, force = CONICAL[angle]
    start = (("body.ball.pose.position", (radius, 0.0, height)), ("body.ball.velocity", (0.0, speed, 0.0)))
    dataset = run(PRELOAD, (*start, ("time.end", "20 ms"), ("output.interval", "0.2 ms")))
    # asked for is 1e-6; the start is typed to 1e-16 m of a penetration of 9e-8 m, and the run is at 1e-10
    assert dataset.contact_normal_force.values[:, 0] == pytest.approx(force, rel=1e-6)
    assert dataset.position.sel(body="ball", axis="z").values == pytest.approx(height, rel=1e-8)


def test_rolling_frequency() -> None:
    dataset = run(ROLLING)
    crossings = falls_through(dataset.time.values, dataset.position.sel(body="ball", axis="x").values)
    assert len(crossings) == 1
    # from rest at 0.1 rad, whose period is longer by 0.1^2 / 16; the law creeps at a small share of v_s, asked: 0.1 %
    quarter = (1.0 + 0.1**2 / 16.0) / (4.0 * KNOWN["rolling"])
    assert crossings[0] == pytest.approx(quarter, rel=1e-3)


def test_rolling_spins_the_ball_as_it_must() -> None:
    dataset = run(ROLLING)
    spin = dataset.angular_velocity.sel(body="ball", axis="y").values
    speed = dataset.velocity.sel(body="ball", axis="x").values
    # the lowest point rests: v = omega R, but for the creep below v_s = 0.02 mm/s
    assert np.abs(speed - spin * 0.02).max() <= 2e-5
    assert np.abs(speed).max() > 4e-3


def test_rolling_friction_takes_next_to_nothing_and_never_drives() -> None:
    dataset = run(ROLLING)
    # the difference of two squares that agree to 1e-3 keeps half of the digits
    require_coulomb(dataset, within=1e-7)
    assert float(dataset.contact_friction_loss[-1, 0]) <= 0.01 * float(np.ptp(dataset.potential.values))


def test_a_start_in_contact_without_a_declared_speed_is_refused() -> None:
    from flexclear.system.errors import InputError

    with pytest.raises(InputError, match="initial_approach_speed"):
        run(PRELOAD, (("joint.contact.initial_approach_speed", None),))


def test_the_slope_of_friction_is_reported_as_the_stiffness_that_limits_the_steps() -> None:
    dataset = run(ROLLING)
    # slope 1.5 mu_s N / v_s over the mass that the contact point feels, 1/m + R^2/I of a solid ball
    pressed = float(dataset.contact_normal_force.max())
    known = 1.5 * 0.15 * pressed / 2e-5 * (1.0 / MASS + 0.02**2 / 57.6e-6)
    # an estimate of the spectral radius, from two slopes
    assert dataset.attrs["largest_rate"] == pytest.approx(known, rel=0.05)
    assert dataset.attrs["stiff_share"] > 0.3
    assert run(PRELOAD).attrs["stiff_steps"] == 0


def test_a_run_that_stiffness_makes_too_long_is_refused_in_words() -> None:
    from flexclear.system.errors import SolverError

    with pytest.raises(SolverError, match="limited by stability"):
        run(ROLLING, (("solver.evaluations", 20000),))


# Bristles: LuGre's friction ------------------------------------------------------------------------------------------


def at(angle: float, static: float, dynamic: float, end: str) -> Overrides:
    """Let go at rest at an angle [rad] next to the lowest point."""
    law = (
        ("law", "lugre"), ("static", static), ("dynamic", dynamic), ("v_stribeck", 1e-3),
        ("bristle_stiffness", 1e5), ("bristle_damping", 20.0),
    )  # fmt: skip
    reach = CONTACT.clearance + (MASS * GRAVITY * math.cos(angle) / CONTACT.stiffness) ** (2.0 / 3.0)
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
