"""Scenes of one ball in a socket: engine against closed forms and one-dimensional integration."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic.mechanism_runs import falls_through, impacts, run
from tests.reference import contact_solutions as exact
from tests.reference import sps4

BOUNCE, SWING = "checks/bounce", "checks/socket_swing"
STIFFNESS, MASS, CLEARANCE, SPEED = 1e8, 1.0, 0.1, 0.7
#: a ball thrown at the socket's wall without weight: the free impact of the closed forms
FREE = (
    ("load.gravity.acceleration", (0.0, 0.0, 0.0)),
    ("body.ball.velocity", (0.0, 0.42, -0.56)),
    ("time.end", "0.2 s"),
)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.7, 0.9, 1.0])
def test_free_impact_gives_the_closed_forms_rebound_depth_and_time(restitution: float) -> None:
    found = impacts(run(BOUNCE, (*FREE, ("joint.contact.normal.restitution", restitution))))
    a = exact.hysteresis(restitution)
    assert found["start"] == pytest.approx([CLEARANCE / SPEED], abs=1e-11)
    assert found["approach"] == pytest.approx([SPEED], rel=1e-11)
    # rtol of the run is 1e-10; the rebound collects some ten steps of it
    assert found["separation"] == pytest.approx([SPEED * exact.delivered_restitution(a)], rel=1e-8)
    if restitution == 1.0:
        assert found["duration"] == pytest.approx([exact.hertz_time(MASS, SPEED, STIFFNESS)], rel=1e-8)
        deep = exact.largest_depth(MASS, SPEED, STIFFNESS, 0.0)
        # the peak is read from samples of the dense output by a parabola
        assert found["peak_force"] == pytest.approx([STIFFNESS * deep**1.5], rel=1e-4)


def test_falling_ball_stays_on_the_vertical() -> None:
    position = run(BOUNCE).position.sel(body="ball").values
    assert np.abs(position[:, :2]).max() <= 1e-15


def test_swing_on_the_floor_has_the_pendulums_period() -> None:
    dataset = run(SWING)
    contact = sps4.Contact()
    depth = exact.resting_depth(0.36, contact.stiffness, 9.81)
    period = exact.swing_period(contact.clearance, depth, 9.81, 0.1)
    x = dataset.position.sel(body="ball", axis="x").values
    crossings = falls_through(dataset.time.values, x)
    # it chatters on the contact 2 kHz above the swing, which lightens it by its amplitude over the clearance
    assert np.diff(crossings) == pytest.approx(period, rel=1e-3)
    assert crossings[0] == pytest.approx(0.25 * period, rel=1e-3)


def test_lossless_swing_keeps_its_energy() -> None:
    dataset = run(SWING)
    # of the little energy in the swing itself, after some hundred openings and closings
    assert np.abs(dataset.energy_error).max() <= 1e-7 * np.abs(dataset.potential).max()
    # nothing but rounding of the two equal forces whose difference dissipates
    assert np.abs(dataset.dissipated).max() <= 1e-13 * np.abs(dataset.potential).max()
