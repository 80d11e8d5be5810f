"""Sarrus' and Bennett's linkages, Watt's governor, a flexible slider-crank: against derivations of their own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.analytic.mechanism_runs import run
from tests.reference import flexible_slider_crank

TIGHT = (("solver.rtol", 1e-12),)
G = 9.81


def test_bennetts_linkage_keeps_its_relation_of_angles() -> None:
    """tan(first / 2) tan(second / 2) = sin((b + a) / 2) / sin((b - a) / 2), a and b the twists; opposite ones agree."""
    dataset = run("checks/bennett", TIGHT)
    a = np.radians(70.0)
    b = np.arcsin(0.2 * np.sin(a) / 0.3)
    first, second, third, last = (dataset.joint_position.sel(coordinate=n).values for n in dataset.joint.values)
    constant = np.sin(0.5 * (b + a)) / np.sin(0.5 * (b - a))
    # written without tangents, which pass infinity; loops are closed to 1e-12
    sides = np.sin(0.5 * first) * np.sin(0.5 * second), constant * np.cos(0.5 * first) * np.cos(0.5 * second)
    assert sides[0] == pytest.approx(sides[1], rel=0, abs=1e-10)
    assert np.cos(first) == pytest.approx(np.cos(third), rel=0, abs=1e-10)
    # the last one is counted from its start
    assert np.cos(second - second[0]) == pytest.approx(np.cos(last), rel=0, abs=1e-10)
    assert np.ptp(first) > 1.0
    assert set(dataset.mobility.values) == {1}
    assert dataset.attrs["redundant_closure_rows"] == 3
    # some hundred steps of rtol 1e-12 at energies of a few joules
    assert np.abs(dataset.energy_error.values).max() < 1e-9


@pytest.mark.slow
def test_watts_governor_moves_as_its_two_coordinates_do() -> None:
    """The coordinates are the spindle's angle and that of the arms against the spindle."""
    dataset = run("checks/governor", TIGHT)
    r = 0.016

    def rates(_: float, y: np.ndarray) -> list[float]:
        s, c, rate, spin = np.sin(y[0]), np.cos(y[0]), y[1], y[3]
        masses, arms = np.array([0.4, 3.0, 0.2]), np.array([0.1, 0.2, 0.05])
        slender = 1.3e-3 + 1.7e-4 - 1e-5 - 1e-6
        J = 0.011 + 2.0 * (masses @ (r + arms * s) ** 2 + 3e-3 + 1.1e-5 + slender * s**2)
        dJ = 2.0 * (2.0 * masses @ ((r + arms * s) * arms * c) + 2.0 * slender * s * c)
        M = 2.0 * (0.4 * 0.01 + 1.3e-3 + 3.0 * 0.04 + 3e-3 + 0.2 * (0.0025 * c**2 + 0.0225 * s**2) + 1.7e-4)
        M += 1.2 * 0.04 * s**2
        dM = 2.0 * 0.2 * 0.04 * s * c + 1.2 * 0.08 * s * c
        lift = 0.2 * s
        force = -1000.0 * (0.25 - 0.2 * c) - 20.0 * lift * rate
        weight = -G * s * (2.0 * (0.4 * 0.1 + 3.0 * 0.2 + 0.2 * 0.15) + 1.2 * 0.2)
        arm = (0.5 * spin**2 * dJ - 0.5 * rate**2 * dM + weight + force * lift) / M
        return [rate, arm, spin, (2.0 - 0.05 * spin - dJ * rate * spin) / J]

    t = dataset.time.values
    start = [np.radians(30.0), 0.0, 0.0, 2.0 * np.pi]
    known = solve_ivp(rates, (0.0, t[-1]), start, "DOP853", t, rtol=1e-12, atol=1e-14).y
    found = dataset.joint_position
    # both integrate with rtol 1e-12 over two seconds and four turns
    assert found.sel(coordinate="sleeve").values == pytest.approx(-0.2 * np.cos(known[0]), abs=1e-9)
    assert found.sel(coordinate="spindle").values == pytest.approx(known[2], abs=1e-8)
    assert set(dataset.mobility.values) == {2}


@pytest.mark.slow
def test_a_flexible_slider_crank_moves_as_a_planar_derivation_says() -> None:
    """Both have five sines across the rod and one quarter wave along it, and all terms of the floating frame."""
    dataset = run("checks/flexible_slider_crank", (("solver.rtol", 1e-11),))
    known = flexible_slider_crank.solve(dataset.time.values, bending=5, axial=1)
    slider = dataset.sel(body="slider")
    bent = known["deflection"]
    assert np.abs(bent).max() > 1e-3
    ends = dataset.frame_position.sel(frame=["rod.crank", "rod.slider"]).values[:, :, :2]
    middle = dataset.frame_position.sel(frame="rod.middle").values[:, :2]
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    offset = middle - ends[:, 0]
    across = along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0]
    # sixteen elements make the frequencies too high, from 1e-6 of the first to 6e-4 of the fifth
    assert across == pytest.approx(bent, rel=0, abs=1e-4 * np.abs(bent).max())
    assert slider.position.values[:, 0] == pytest.approx(known["slider"], rel=0, abs=5e-7)
    assert dataset.sizes["mode"] == 12
