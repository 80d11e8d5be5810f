"""Pendulum and heavy top against published tables, at the accuracy asked for and at tight tolerance."""

from __future__ import annotations

import numpy as np
import pytest

from flexclear.pipeline.core.numerics.rotations import quaternion_to_matrix
from tests.analytic.mechanism_runs import run

#: IFToMM A01, closed form in Jacobi's functions: time [s], x, y [m]
PENDULUM = [
    (2.0, -0.793566195343323, -0.60848393044379),
    (4.0, 0.5775636282486305, -0.8163456714678395),
    (10.0, -0.275087462576117, -0.961419205099125),
]
# fast heavy top of Terze, Mueller & Zlatar, MSD 38 (2016), as in Exudyn's verification: time [s], centre of mass [m],
# angular velocity in body axes [rad/s]
HEAVY_TOP = [
    (
        0.5,
        (-0.7024682970567606, -0.02116518470149531, -0.7114002576515746),
        (-0.4710531017406381, 150.0, 5.901083048325021),
    ),
    (
        1.0,
        (0.1733439640981861, 0.6400885920701305, -0.7484907911340024),
        (-0.8220781016925478, 150.0, -5.923291348116807),
    ),
    (
        2.0,
        (-0.15041682274663784, -0.7241655916373482, -0.6730222695597349),
        (0.12223321947817933, 150.0, -5.855624589203498),
    ),
]  # fmt: skip


@pytest.mark.parametrize("rtol, within", [(1e-10, 1e-5), (1e-13, 1e-8)], ids=["accepted", "tight"])
def test_pendulum(rtol: float, within: float) -> None:
    """Accepted: 1e-5 m at 10 s."""
    dataset = run("checks/pendulum", (("solver.rtol", rtol),)).position.sel(body="bob")
    for t, x, y in PENDULUM:
        there = dataset.sel(time=t, method="nearest")
        assert float(there.time) == pytest.approx(t, abs=1e-12)
        assert there.values == pytest.approx([x, y, 0.0], abs=within)


@pytest.mark.parametrize("rtol, within", [(1e-10, 1e-5), (1e-13, 1e-8)], ids=["accepted", "tight"])
def test_heavy_top(rtol: float, within: float) -> None:
    """Accepted: 1e-5 m at 1 s, and the spin kept."""
    dataset = run("checks/heavy_top", (("time.end", 2.0), ("solver.rtol", rtol))).sel(body="top")
    for t, centre, omega in HEAVY_TOP:
        there = dataset.sel(time=t, method="nearest")
        assert there.position.values == pytest.approx(centre, abs=within)
        spin = quaternion_to_matrix(there["quaternion"].values).T @ there.angular_velocity.values
        # angles and rates of a spin of 150 rad/s; the table's start has five digits
        assert spin == pytest.approx(omega, abs=100.0 * within)
    omega = np.einsum("tji,tj->ti", quaternion_to_matrix(dataset["quaternion"].values), dataset.angular_velocity.values)
    assert omega[:, 1] == pytest.approx(150.0, rel=1e-9)
