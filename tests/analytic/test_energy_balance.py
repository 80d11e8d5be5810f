"""Runs whose energy balance is off say so, and those that are far off, or diverge, are refused."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from benchmarks.families import classes
from flexclear.pipeline.core.system.errors import SolverError
from tests.properties.mechanisms import joint, rigid, scene, simulate, simulated


def bounce(solver: dict[str, Any]) -> xr.Dataset:
    """A ball falls by 0.2 m on a hard plane and rebounds without loss: 1.96 J are exchanged."""
    return simulated(classes.bounce(**solver))


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
        bounce(solver)


def test_a_scene_may_allow_an_error_and_the_run_warns_of_it() -> None:
    solver = {"integrator": "rk4", "step": 0.05, "ledger_tolerance": 1.0}
    allowed = bounce(solver)
    error = float(np.abs(allowed.energy_error).max())
    assert f"the energy balance is off by {error:.3g} J" in allowed.attrs["warnings"]


def test_a_run_that_closes_warns_of_nothing() -> None:
    closed = bounce({"integrator": "dop853"})
    assert closed.attrs["warnings"] == ""
    assert np.abs(closed.energy_error).max() < 1e-6 * 1.96


@pytest.mark.parametrize("size, end", [(1e-6, 6.0), (1.0, 6.0), (1.0, 0.3), (1e3, 0.3), (1e3, 6.0)])
def test_a_controller_that_makes_the_motion_unstable_is_refused(size: float, end: float) -> None:
    """A held force after 0.1 s: each sample multiplies the deviation by about 1 - 5000 (0.1)^2 / 2 = -24.

    Also in short runs, which end before the speed is beyond mechanics: 1 km beyond a reference of 0.1 m after 0.3 s.
    """
    bodies = {"ground": {"type": "ground", "frames": {"o": {}}}, "slide": rigid(1.0, 0.01, {"o": {}})}
    gains = {"proportional": 5000.0, "derivative": 0.0, "period": 0.1}
    load = {"c": {"type": "sampled-pid", "joint": "p", "reference": 0.1 * size, **gains}}
    rail = {"p": joint("prismatic", "ground.o", "slide.o")}
    with pytest.raises(SolverError, match=r"the motion diverges: controller c has its coordinate at .* m"):
        simulate(scene(bodies, rail, end, load=load, output={"interval": 0.01}, solver={}))
