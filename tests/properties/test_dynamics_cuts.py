"""A joint moves a mechanism alike whether the tree takes it or a loop is closed by it."""

import numpy as np
import pytest
import xarray as xr

from flexclear.dynamics.model import tree
from tests.properties.mechanisms import simulate, two_loops

#: joints that may close the two loops; the tree takes the others
CUTS = (("U", "P"), ("Y", "R"), ("S", "T"))

DRIVES = {
    "second": {
        "joint": "U",
        "coordinate": "second",
        "law": {"type": "polynomial", "coefficients": [0.0, 0.0, 2.0, -3.0]},
    },
    "x": {"joint": "P", "coordinate": "x", "law": {"type": "polynomial", "coefficients": [0.0, 0.0, 0.5]}},
}


def run(monkeypatch: pytest.MonkeyPatch, swapped: bool, cut: tuple[str, ...], driven: bool = False) -> xr.Dataset:
    """The run whose loops are closed by the joints `cut`.

    swapped: whether the joints with several axes have their first frames on the moving bodies.
    """
    table = two_loops() | ({"drive": DRIVES} if driven else {})
    if swapped:
        for name in ("U", "Y", "P"):
            table["joint"][name]["between"].reverse()
    with monkeypatch.context() as patch:
        patch.setattr(tree, "_freedom", lambda edge: int(edge.name in cut))
        return simulate(table)


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True])
def test_it_does_not_matter_which_joints_close_the_loops(monkeypatch: pytest.MonkeyPatch, swapped: bool) -> None:
    known, *others = (run(monkeypatch, swapped, cut) for cut in CUTS)
    size = float(np.abs(known.position - known.position.isel(time=0)).max())
    assert size > 0.05  # it moves
    for other in others:
        # errors of rtol 1e-12 per step over some tens of steps
        assert np.abs(other.position.values - known.position.values).max() < 1e-9 * size
        for field in ("velocity", "acceleration", "angular_acceleration", "joint_force", "joint_moment"):
            largest = float(np.abs(known[field]).max())
            assert np.abs(other[field].values - known[field].values).max() < 1e-8 * largest, field
        for field in ("joint_position", "joint_velocity"):
            assert list(other.coordinate) == list(known.coordinate)
            assert other[field].values == pytest.approx(known[field].values, abs=1e-8), field
    for dataset in (known, *others):
        assert float(np.abs(dataset.energy_error).max()) < 1e-9 * float(dataset.kinetic.max())


@pytest.mark.slow
@pytest.mark.parametrize("swapped", [False, True])
def test_one_freedom_of_a_joint_may_be_driven_whichever_way_the_tree_meets_it(
    monkeypatch: pytest.MonkeyPatch, swapped: bool
) -> None:
    """Both drives hold their law, and the other freedoms follow alike from either tree."""
    known, other = (run(monkeypatch, swapped, cut, driven=True) for cut in CUTS[1:])
    t = known.time.values
    for dataset in (known, other):
        second, x = (dataset.joint_position.sel(coordinate=name).values for name in ("U.second", "P.x"))
        assert second == pytest.approx(2.0 * t**2 - 3.0 * t**3, abs=1e-13)
        assert x == pytest.approx(0.5 * t**2, abs=1e-13)
        power = (dataset.drive_force * 0.0).sum("drive").values
        rates = {"second": 4.0 * t - 9.0 * t**2, "x": t}
        for name, rate in rates.items():
            power = power + dataset.drive_force.sel(drive=name).values * rate
        by_trapezoid = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
        work = dataset.drive_work.values
        # forces that bend over the run in twenty trapezoids
        assert by_trapezoid == pytest.approx(work, abs=0.02 * np.abs(work).max())
    for field in ("position", "velocity", "acceleration", "joint_force", "drive_force", "joint_position"):
        largest = float(np.abs(known[field]).max())
        assert np.abs(other[field].values - known[field].values).max() < 1e-8 * largest, field
