"""No contact is stepped over, however long the steps: a sprung ball swings a little beyond its socket's wall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.properties.mechanisms import Table, joint, rigid, simulate

#: radius of the swing [m] and its rate [rad/s]; the period is 2 pi s
SWING, RATE = 1.0, 1.0


def scene(clearance: float, phase: float, solver: dict[str, Any]) -> Table:
    """A ball on a spring along x, let go inside the socket at a phase of its swing, until it is back there."""
    along = {"axes": {"z": [1, 0, 0], "x": [0, 1, 0]}}
    start = {
        "pose": {"position": [SWING * np.sin(phase), 0.0, 0.0]},
        "velocity": [SWING * RATE * np.cos(phase), 0.0, 0.0],
    }
    contact = {
        **joint("clearance-spherical", "ground.socket", "ball.centre"),
        "clearance": clearance,
        "ball_radius": 0.5,
        "normal": {"law": "hertz", "stiffness": 1e6},
    }
    return {
        "title": "sprung ball",
        "time": {"end": 2.0 * np.pi / RATE},
        "output": {"interval": 10.0},
        "solver": {**solver, "ledger_tolerance": 1.0},  # loose on purpose
        "body": {
            "ground": {"type": "ground", "frames": {"socket": {}, "rail": along}},
            "ball": rigid(1.0, 0.1, {"centre": {}, "rail": along}, **start),
        },
        "joint": {"rail": joint("prismatic", "ground.rail", "ball.rail"), "contact": contact},
        "load": {"spring": {"type": "joint-spring", "joint": "rail", "stiffness": RATE**2}},
    }


@pytest.mark.parametrize("clearance", [0.9, 0.97, 0.995])
@pytest.mark.parametrize("phase", [-1.0, -0.5, 0.0, 0.6])
@pytest.mark.parametrize(
    "solver", [{"rtol": 1e-2}, {"rtol": 1e-3}, {"rtol": 1e-6}, {"rtol": 1e-3, "integrator": "dopri5"}]
)
def test_the_first_touch_is_found_at_any_tolerance(clearance: float, phase: float, solver: dict[str, Any]) -> None:
    """Steps of order 8 at loose tolerances are longer than the swing takes to and from the wall."""
    run = simulate(scene(clearance, phase, solver))
    touch = (np.arcsin(clearance / SWING) - phase) / RATE
    assert len(run.event_time) > 0
    # the error of a step is rtol of the swing, and the ball meets the wall at sqrt(1 - c^2) of its largest speed
    allowed = 10.0 * solver["rtol"] / np.sqrt(1.0 - clearance**2)
    assert float(run.event_time[0]) == pytest.approx(touch, abs=allowed)


@pytest.mark.parametrize("clearance", [1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("solver", [{"rtol": 1e-3}, {"rtol": 1e-10}, {"rtol": 1e-6, "integrator": "dopri5"}])
def test_the_first_touch_is_found_in_a_step_of_many_clearances(clearance: float, solver: dict[str, Any]) -> None:
    """A parabola 3 m away is one step: beyond the socket's wall by a fiftieth of the clearance, and out below."""
    gravity, below = 10.0, 0.3 * clearance
    up = np.sqrt(2.0 * gravity * (1.02 * clearance + below))
    touch = (up - np.sqrt(up**2 - 2.0 * gravity * (clearance + below))) / gravity
    parts = scene(clearance, 0.0, solver)
    del parts["joint"]["rail"]
    parts["load"] = {"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -gravity]}}
    parts["body"]["ground"]["frames"]["socket"] = {"position": [3.0, 0.0, 0.0]}
    parts["body"]["ball"] |= {"pose": {"position": [3.0, 0.0, -below]}, "velocity": [0.0, 0.0, up]}
    parts["time"] = {"end": 1000.0 * touch}  # the first step may be that long
    run = simulate(parts)
    # every method integrates a parabola exactly, and the ball stays exactly 3 m away: left are the root, to 1e-12
    # of the clearance, and the rounding of differences where the ball has an eighth of its speed left
    assert float(run.event_time[0]) == pytest.approx(touch, rel=1e-8)
