"""Beams that turn: with geometric stiffening they are right, without it they are the linear theory."""

from functools import cache

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline import dynamics
from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.errors import SolverError
from tests.analytic.mechanism_runs import TREE, bundles, frequencies
from tests.reference.turning_beams import SPIN_UP, WRIGHT

#: sqrt(E I / (rho A)) / L^2 of meshes/checks/slender_beam.toml [rad/s]
UNIT = np.sqrt(200e9 / 7850.0) * 1e-3
LENGTH = 10.0


def turning(gamma: float) -> tuple[str, object]:
    return "drive.axle.law.coefficients", (0.0, gamma * UNIT)


def flapping_and_lagging(gamma: float, **changes: object) -> tuple[np.ndarray, np.ndarray]:
    """First three frequencies across and within the plane of turning, in units of UNIT."""
    overrides = (turning(gamma), *changes.items())
    found = frequencies("checks/rotating_beam", overrides, moving=True)
    size = np.abs(found.frame_translation.sel(frame="beam.tip").values).max(axis=1)
    omega = 2.0 * np.pi * found.frequency.values / UNIT
    bends = size.max(axis=1) > 0.1 * size.max()  # the others twist
    across = size.argmax(axis=1) == 2
    return omega[bends & across][:3], omega[bends & ~across][:3]


@pytest.mark.parametrize("gamma", WRIGHT)
def test_a_turning_cantilever_has_wrights_frequencies(gamma: int) -> None:
    """The table is required to 1e-3. Sixteen elements and a basis of 20 coordinates leave 3e-4 at most."""
    flap, lag = flapping_and_lagging(gamma)
    assert flap == pytest.approx(WRIGHT[gamma][0], rel=3e-4)
    assert lag == pytest.approx(WRIGHT[gamma][1], rel=3e-4)


def test_linear_shapes_let_a_turning_cantilever_soften() -> None:
    """Floating frames with linear shapes: flapping does not change, lagging falls to omega^2 - Omega^2."""
    rest = np.array(WRIGHT[0][0])
    flap, lag = flapping_and_lagging(3, **{"body.beam.stiffening": None})
    # 16 elements and 20 coordinates: 1e-4; the squares differ by nearly as much as they are
    assert flap == pytest.approx(rest, rel=2e-4)
    assert lag == pytest.approx(np.sqrt(rest**2 - 9.0), rel=2e-4)


def test_beyond_its_first_frequency_the_linear_beam_bends_away() -> None:
    """Gamma = 4 > 3.516: the first lagging motion grows, as Kane, Ryan and Banerjee found it in programs of 1987."""
    overrides = (turning(4.0), ("body.beam.stiffening", None))
    found = frequencies("checks/rotating_beam", overrides, moving=True)
    growth = UNIT * np.sqrt(16.0 - WRIGHT[0][0][0] ** 2)
    assert -found.decay_rate.values.min() == pytest.approx(growth, rel=1e-4)


def test_motion_that_is_not_steady_is_refused() -> None:
    """Under gravity the load on a turning beam changes from moment to moment."""
    gravity = ("load", {"weight": {"type": "gravity", "acceleration": (0.0, -9.81, 0.0)}})
    with pytest.raises(SolverError, match="not steady"):
        frequencies.__wrapped__("checks/rotating_beam", (gravity,), moving=True)


def tip(found: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Motion of the tip along and across the undeformed axis, shape (time,) each [m]."""
    w, _, _, z = found["quaternion"].sel(body="hub").values.T
    angle = 2.0 * np.arctan2(z, w)
    r = (found.frame_position.sel(frame="beam.tip") - found.frame_position.sel(frame="beam.root")).values
    along, across = np.cos(angle) * r[:, 0] + np.sin(angle) * r[:, 1], np.cos(angle) * r[:, 1] - np.sin(angle) * r[:, 0]
    return along - LENGTH, across


SCENES: dict[str, tuple[str, dict[str, object]]] = {
    "6 rad/s with stiffening": ("checks/spinup_beam_stiffened", {}),
    "2 rad/s with stiffening": ("checks/spinup_beam", {"body.beam.stiffening": {}}),
    "2 rad/s linear FFR": ("checks/spinup_beam", {}),
}


@cache
def spun(case: str, rtol: float = 1e-10) -> xr.Dataset:
    """The run of a case."""
    name, overrides = SCENES[case]
    scene = load_scene(TREE / "scenes" / f"{name}.toml", {**overrides, "solver.rtol": rtol})
    return dynamics.simulate(scene, bundles(scene), lambda fraction, text: None)


@pytest.mark.parametrize("case", SCENES)
def test_a_beam_spun_up_lags_and_recovers_as_assumed_modes_say(case: str) -> None:
    """The deflection is required to 1 % of its largest; two modal bases of one theory agree to 1e-4."""
    known = np.array(SPIN_UP[case])
    found = spun(case)
    rows = [int(np.argmin(np.abs(found.time.values - t))) for t in known[:, 0]]
    along, across = tip(found)
    largest = np.abs(known[:, 1]).max()
    assert across[rows] == pytest.approx(known[:, 1], abs=1e-4 * largest)
    foreshortened = known[:, 3] if "stiffening" in case else 0.0
    # the axial vibration of 1e-6 m has six modes there and fewer here
    assert along[rows] == pytest.approx(known[:, 2] + foreshortened, abs=3e-6)


@pytest.mark.parametrize("case", SCENES)
def test_the_spun_beam_ends_stretched_by_its_centrifugal_force(case: str) -> None:
    """Steady stretch tan(k L)/k - L with k^2 = rho A omega^2 / (E A): the mean about which it vibrates."""
    speed = float(case.split()[0])
    k = np.sqrt(1.2 / 2.8e7) * speed
    found = spun(case)
    along, across = tip(found)
    late = found.time.values >= 15.0
    # the residual bending vibration b shortens it: by 1.2 b^2 / (2 L) in the first mode, if that is modelled
    shortened = 0.6 * np.mean(across[late] ** 2) / LENGTH if "stiffening" in case else 0.0
    stretch = np.tan(k * LENGTH) / k - LENGTH
    assert np.mean(along[late]) == pytest.approx(stretch - shortened, rel=1e-3)


@pytest.mark.parametrize("case", SCENES)
def test_energy_and_work_of_the_spin_up_agree(case: str) -> None:
    """A shortening that were not Lagrangian would show at 1e-4.

    Axial modes that nothing moves limit the steps by stability and ring up to the tolerance, at random: at neighbouring
    tolerances of 1e-10 the error is anything from 2e-15 to 2e-11 of the energy, whatever groups its norm has.
    At 1e-12 what rings is a hundred times smaller, its energy ten thousand times: of some thirty such runs the worst
    had 3e-14.
    """
    found = spun(case, 1e-12)
    assert np.abs(found.energy_error).max() < 1e-12 * found.kinetic.max()
    assert found.drive_work.values[-1] == pytest.approx(found.kinetic.values[-1] + found.elastic.values[-1], rel=1e-12)
