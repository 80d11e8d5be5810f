"""Equilibria and natural frequencies through the stages: what the command prints, what is kept, what is refused."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import flexclear as fc
from flexclear.commands.frequencies import text
from flexclear.scene.load import load_scene
from flexclear.stages.graph import Graph
from flexclear.system.errors import FlexclearError, InputError
from tests.stages.conftest import Command


def test_the_command_prints_pose_residual_and_mobility_then_the_table(command: Command) -> None:
    lines = command("frequencies", "checks/pendulum", "--at", "500 ms").out.splitlines()
    assert lines[0] == "checks/pendulum at t = 0.5 s, drives held"
    assert lines[1].startswith("equilibrium: largest unbalanced force")
    assert lines[2] == "free motions in addition to the drives: 1"
    number, hertz, damping, owner, fraction = lines[-1].split(maxsplit=4)
    assert (number, damping, owner, fraction) == ("1", "0", "bob", "(100 %)")
    assert float(hertz) == pytest.approx(np.sqrt(9.81) / (2.0 * np.pi), rel=1e-6)


def test_redundant_closures_are_reported_where_reactions_depend_on_them() -> None:
    """A four-bar of hinges whose motor is held: three conditions too many, and nothing that could vibrate."""
    reported = {
        "scene": "four_bar", "time": 0.0, "drives": "held", "residual": 0.0, "iterations": 0, "mobility": 0,
        "motions_without_stiffness": 0, "redundant_closure_rows": 3, "undetermined_reactions": "A, B, C, D",
    }  # fmt: skip
    still = xr.Dataset(coords={"vibration": np.zeros(0, dtype=int)}, attrs=reported)
    *_, mobility, repeated, nothing = text(still).splitlines()
    assert mobility == "free motions in addition to the drives: 0"
    assert repeated.startswith("3 loop closure conditions are redundant, as are three in a planar loop:")
    assert repeated.endswith("rigid bodies do not determine the reactions of A, B, C, D")
    assert nothing == "nothing vibrates: joints and drives hold all bodies"
    still.attrs |= {"redundant_closure_rows": 2, "undetermined_reactions": ""}  # as of gears: nothing depends on them
    assert "conditions" not in text(still)


@pytest.mark.parametrize(
    "at, said", [("3 kg", "'3 kg' is a mass"), ("soon", "not a number with a unit"), ("11", "0 to 10 s")]
)
def test_a_wrong_time_is_refused(command: Command, at: str, said: str) -> None:
    assert said in command("frequencies", "checks/pendulum", "--at", at, code=2).err


def test_an_unknown_drive_is_refused() -> None:
    with pytest.raises(FlexclearError, match="unknown drive") as caught:
        fc.equilibrium("checks/pendulum", drives={"motor": 0.1})
    assert caught.value.exit_code == InputError.exit_code


def test_an_equilibrium_comes_from_the_cache_and_says_what_its_numbers_mean() -> None:
    first, again = (fc.equilibrium("checks/pendulum") for _ in range(2))
    assert first.identical(again)
    assert "frequency" not in first
    assert first.attrs["Conventions"].startswith("CF-")
    assert first.position.attrs["units"] == "m"
    both = fc.frequencies("checks/pendulum")
    assert both.frequency.attrs["units"] == "Hz"
    assert both.position.values == pytest.approx(first.position.values, abs=1e-14)


def test_only_what_matters_is_in_the_key() -> None:
    """How often a run is recorded does not move an equilibrium; where it is looked at does."""
    graphs = [Graph(load_scene(Path("scenes/checks/pendulum.toml"), o)) for o in ({}, {"output.interval": 0.1})]
    usual, coarser = (g.linear(0.5).params for g in graphs)
    assert usual == coarser
    assert usual != graphs[0].linear(0.6).params
    assert usual != graphs[0].linear(0.5, vibrations=False).params
