"""Starts: what the scene gives is kept where the joints allow it, and refused where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import InputError
from tests.properties.mechanisms import simulate
from tests.properties.test_dynamics_cuts import two_loops


@pytest.mark.slow
def test_one_body_sets_its_whole_loop_in_motion() -> None:
    """From rest all accelerations are admissible velocities: given one body's as velocity, the others' must follow."""
    at_rest = simulate(two_loops(False)).isel(time=0)
    moving = two_loops(False)
    given = {name: at_rest.sel(body=name) for name in ("a", "d")}
    for name, start in given.items():
        moving["body"][name]["angular_velocity"] = start.angular_acceleration.values.tolist()
        moving["body"][name]["velocity"] = start.acceleration.values.tolist()
    found = simulate(moving).isel(time=0)
    size = float(np.abs(at_rest.acceleration).max())
    # rounding of the equations at rest
    assert found.velocity.values == pytest.approx(at_rest.acceleration.values, abs=1e-11 * size)
    assert found.angular_velocity.values == pytest.approx(at_rest.angular_acceleration.values, abs=1e-11 * size)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a", "d"])
def test_velocities_that_would_open_a_loop_are_refused(name: str) -> None:
    table = two_loops(False)
    table["body"][name]["angular_velocity"] = [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=f"velocities given for {name}") as error:
        simulate(table)
    assert f"[body.{name}.velocity]" in str(error.value)
    assert "miss by" in str(error.value)
