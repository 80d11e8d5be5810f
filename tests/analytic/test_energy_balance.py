"""Runs whose energy balance is off say so, and those that are far off, or diverge, are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.schema import Scene
from flexclear.pipeline.core.system.errors import SolverError
from flexclear.pipeline.core.system.progress import silent

BODY = {"type": "rigid", "mass": 1.0, "inertia": [0.01, 0.01, 0.01]}


def bounce(solver: dict[str, Any]) -> Scene:
    """A ball that falls by 0.2 m on a hard plane and rebounds without loss: 1.96 J are exchanged."""
    plane = {
        "type": "ball-on-plane",
        "between": ["ground.f", "ball.c"],
        "ball_radius": 0.1,
        "normal": {"law": "hertz", "stiffness": 1e8},
    }
    return Scene.model_validate(
        {
            "title": "bounce",
            "time": {"end": 1.0},
            "output": {"interval": 0.1},
            "load": {"g": {"type": "gravity", "acceleration": [0, 0, -9.81]}},
            "body": {
                "ground": {"type": "ground", "frames": {"f": {}}},
                "ball": BODY | {"pose": {"position": [0, 0, 0.3]}, "frames": {"c": {}}},
            },
            "joint": {"f": plane},
            "solver": solver,
        }
    )


@pytest.mark.parametrize(
    "solver",
    [
        {"integrator": "adams-bashforth-moulton", "step": 1e-3, "events": "at step ends"},
        {"integrator": "rk4", "step": 0.05, "events": "located"},
    ],
    ids=["contact at step ends", "a step longer than the contact"],
)
def test_a_run_that_gains_more_than_a_tenth_of_its_energy_is_refused(solver: dict[str, Any]) -> None:
    words = r"energy balance does not close.*tolerance 0\.1, \[solver\.ledger_tolerance\]"
    with pytest.raises(SolverError, match=words):
        dynamics.simulate(bounce(solver), {}, silent)


def test_a_scene_may_allow_an_error_and_the_run_warns_of_it() -> None:
    solver = {"integrator": "rk4", "step": 0.05, "ledger_tolerance": 1.0}
    allowed = dynamics.simulate(bounce(solver), {}, silent)
    error = float(np.abs(allowed.energy_error).max())
    assert f"the energy balance is off by {error:.3g} J" in allowed.attrs["warnings"]


def test_a_run_that_closes_warns_of_nothing() -> None:
    closed = dynamics.simulate(bounce({"integrator": "dop853"}), {}, silent)
    assert closed.attrs["warnings"] == ""
    assert np.abs(closed.energy_error).max() < 1e-6 * 1.96


@pytest.mark.parametrize("size, end", [(1e-6, 6.0), (1.0, 6.0), (1.0, 0.3), (1e3, 0.3), (1e3, 6.0)])
def test_a_controller_that_makes_the_motion_unstable_is_refused(size: float, end: float) -> None:
    """A held force after 0.1 s: each sample multiplies the deviation by about 1 - 5000 (0.1)^2 / 2 = -24.

    Also in short runs, which end before the speed is beyond mechanics: 1 km beyond a reference of 0.1 m after 0.3 s.
    """
    data = {
        "title": "a slow sampler",
        "time": {"end": end},
        "output": {"interval": 0.01},
        "body": {
            "ground": {"type": "ground", "frames": {"o": {}}},
            "slide": BODY | {"frames": {"o": {}}},
        },
        "joint": {"p": {"type": "prismatic", "between": ["ground.o", "slide.o"]}},
        "load": {
            "c": {
                "type": "sampled-pid",
                "joint": "p",
                "reference": 0.1 * size,
                "proportional": 5000.0,
                "derivative": 0.0,
                "period": 0.1,
            }
        },
    }
    with pytest.raises(SolverError, match=r"the motion diverges: controller c has its coordinate at .* m"):
        dynamics.simulate(Scene.model_validate(data), {}, silent)
