"""Extremes lie inside impacts, which are shorter than the output interval: every located event is recorded."""

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.post.single_run.series import derive
from tests.analytic.mechanism_runs import run

DENSER = 50
#: both models are wholly predictable so far, and have had their first impacts
UNTIL = {"sps4/csj": 0.0105, "sps4/far_csj_cb": 0.0085}
#: regular outputs 2 us apart miss the peak of a contact of 60 us or more by up to (pi / 60)^2 / 2, a thousandth (3e-4
#: is found), while outputs 0.1 ms apart miss it by a tenth and more
CLOSE = 4e-3


def pair(name: str) -> tuple[xr.Dataset, xr.Dataset]:
    """A run as its scene has it, and the regular rows alone of one with 50 times denser output."""
    end, interval = ("time.end", UNTIL[name]), 1e-4 / DENSER
    dense = run(name, (end, ("output.interval", interval)))
    regular = np.abs(dense.time.values / interval - np.round(dense.time.values / interval)) < 1e-6
    return run(name, (end,)), dense.isel(time=regular)


@pytest.mark.parametrize("name", UNTIL)
def test_reported_extremes_are_those_of_fifty_times_denser_output(name: str) -> None:
    plain, dense = (derive(one) for one in pair(name))
    for quantity in (
        plain.peak_acceleration.sel(body="platform", axis="z"),
        plain.peak_reaction.sel(joint="A1"),
        plain.peak_force.sel(contact="A1"),
    ):
        where = {key: quantity[key].values for key in ("body", "axis", "joint", "contact") if key in quantity.coords}
        other = float(dense[quantity.name].sel(where))
        assert float(quantity) == pytest.approx(other, rel=CLOSE), quantity.name
        assert other > 0.0


def test_every_event_has_a_row_of_the_motion() -> None:
    plain, _ = pair("sps4/csj")
    assert set(plain.event_kind.values) >= {"closing", "opening", "compression"}
    assert np.isin(plain.event_time.values, plain.time.values).all()
    assert (np.diff(plain.time.values) > 0.0).all()


def test_rows_inside_steps_leave_the_trajectory_as_it_is() -> None:
    """The same states at common times, whatever is recorded besides: looking does not disturb."""
    plain, dense = pair("sps4/csj")
    common = np.intersect1d(plain.time.values, dense.time.values)
    assert len(common) > 30
    a, b = (one.sel(time=common) for one in (plain, dense))
    # the loops of recorded states are closed to rounding, from starts that the dense output gives alike
    assert np.array_equal(plain.event_time.values, dense.event_time.values)
    assert np.abs(a.position.values - b.position.values).max() < 1e-13
