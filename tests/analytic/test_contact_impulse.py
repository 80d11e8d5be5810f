"""Impulse of the normal force, from the ledger, against what the ball's momentum says."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic.mechanism_runs import impacts, run

MASS, GRAVITY = 1.0, 9.81


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
