"""A clearance pin at 5000 rpm: planar motion in space, energy, momentum.

Its impacts are compared with a second derivation in `test_contact_mechanisms`.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.analytic.mechanism_runs import run

SCENE = "checks/clearance_slider_crank"
#: three impacts that end, and the begin of a fourth
OVERRIDES = (("time.end", "1 ms"), ("output.interval", "1 us"))


def test_pin_stays_in_the_plane_of_its_journal() -> None:
    dataset = run(SCENE, OVERRIDES)
    # the closure's tolerance is rtol 1e-10 of a mechanism of 0.2 m; recorded states are a thousand times closer
    assert np.abs(dataset.contact_offset.values[..., 2]).max() <= 1e-12
    assert np.abs(dataset.position.values[..., 2]).max() <= 1e-10


def test_ledger_of_the_slider_crank_closes() -> None:
    dataset = run(SCENE, OVERRIDES)
    assert np.abs(dataset.energy_error).max() <= 1e-9 * dataset.kinetic.max()
    lost = dataset.contact_damping_loss + dataset.contact_friction_loss
    assert lost[-1, 0] == pytest.approx(float(dataset.dissipated[-1]), rel=1e-12)
    assert (dataset.contact_friction_loss.diff("time") >= 0.0).all()


def test_impulse_of_the_contact_is_the_change_of_the_cranks_angular_momentum() -> None:
    """Nothing but the pin has a moment about the main bearing's axis."""
    dataset = run(SCENE, OVERRIDES)
    spin = 0.02 * dataset.angular_velocity.sel(body="crank", axis="z").values
    # the pin is the joint's second frame: force and moment on the crank, there
    pin = dataset.frame_position.sel(frame="crank.pin").values
    force, moment = (dataset[n].sel(joint="pin").values for n in ("joint_force", "joint_moment"))
    about_axis = moment[:, 2] + pin[:, 0] * force[:, 1] - pin[:, 1] * force[:, 0]
    time = dataset.time.values
    impulse = float(np.sum(0.5 * (about_axis[1:] + about_axis[:-1]) * np.diff(time)))
    # trapezia of 1 us on pulses of 100 us and more
    assert spin[-1] - spin[0] == pytest.approx(impulse, rel=1e-4)
    assert abs(impulse) > 1e-3


def test_contact_that_is_too_large_for_hertz_is_said() -> None:
    assert "holds below 0.3" in run(SCENE, OVERRIDES).attrs["warnings"]
