"""Scenes of one ball in a socket: engine against closed forms and one-dimensional integration."""

import numpy as np
import pytest

from tests.analytic.mechanism_runs import falls_through, impacts, run
from tests.reference import contact_solutions as exact
from tests.reference import sps4

BOUNCE, SWING = "checks/bounce", "checks/socket_swing"
MASS = 1.0


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


# Impulse of the normal force, from the ledger, against what the ball's momentum says --------------------------------

GRAVITY = 9.81


def test_every_bounce_turns_the_momentum_around():
    bounce = run("checks/bounce")
    found = impacts(bounce)
    ended = np.isfinite(found["duration"])
    change = MASS * (found["approach"] + found["separation"]) + MASS * GRAVITY * found["duration"]
    start, end = found["start"], found["start"] + found["duration"]
    impulse = bounce.contact_impulse.sel(contact="contact")
    measured = np.array(
        [float(impulse.sel(time=b) - impulse.sel(time=a)) for a, b in zip(start[ended], end[ended], strict=True)]
    )
    # both come from one run at rtol 1e-10; impulses of later bounces are differences of a growing sum
    assert measured == pytest.approx(change[ended], rel=1e-8)


def test_impulse_only_grows_in_contact():
    csj = run("sps4/csj")
    impulse, closed = csj.contact_impulse.values[:, 0], csj.contact_normal_force.values[:, 0] > 0.0
    apart = ~closed[:-1] & ~closed[1:]
    steps = np.diff(impulse)
    assert steps.min() >= 0.0
    # a contact may fall between two outputs; events are outputs too, so none falls between two open ones
    assert np.abs(steps[apart]).max() == 0.0


def test_every_recorded_penetration_carries_its_force():
    """Also in the step that ends with the opening, after which the contact has no force any more."""
    bounce = run("checks/bounce", (("output.interval", 1e-5), ("time.end", 0.2)))
    depth, force = bounce.contact_penetration.values[:, 0], bounce.contact_normal_force.values[:, 0]
    inside = depth > 1e-9  # far above rounding of the 0.1 m gap
    assert inside.sum() > 10
    assert (force[inside] > 0.0).all()
    assert (force[depth == 0.0] == 0.0).all()
