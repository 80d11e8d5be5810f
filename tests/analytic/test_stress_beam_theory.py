"""Section forces and peak stresses of single rods against beam theory, of the paper's by its joints and motion."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from flexclear.pipeline.core.numerics.rotations import quaternion_to_matrix
from tests.analytic.beam_solutions import PAPER_ROD as ROD
from tests.analytic.stress_runs import last, recorded, run

AREA, SECOND = np.pi * ROD.radius**2, np.pi * ROD.radius**4 / 4.0
WEIGHT = ROD.density * AREA * 9.81  #: [N/m]
TIP = (40.0, 30.0, -50.0)  #: force at the tip [N]
SPIN = 100.0  #: [rad/s]
#: overdamped, a rod comes to rest: the slowest motion falls by exp(-30) in 20 ms
RESTING = {"body.rod.damping": 1.0}


@cache
def cantilever() -> dict[str, Any]:
    """Clamped at x = 0, along x of the world, gravity along -z and a force at the tip; at rest."""
    force = {"type": "point-force", "frame": "rod.top", "force": list(TIP)}
    return last(run("checks/clamped_rod", RESTING | {"load.tip": force}))


def on_a_ball_joint(reference: str, count: int, changes: dict[str, Any]) -> xr.Dataset:
    """The rod on a ball joint at x = 0, let go at rest from the horizontal."""
    modes = {"reference": reference, "count": count, "interfaces": ["bottom", "top"]}
    return run("checks/swinging_rod", {"body.rod.modes": modes, "time.end": "20 ms"} | changes)


def rest(x: np.ndarray) -> np.ndarray:
    return ROD.length - x


# Forces -------------------------------------------------------------------------------------------------------------


def test_cantilever_section_forces_are_those_of_beam_theory() -> None:
    """The force at the tip and the weight beyond each section, with the levers of the deflected rod, in axes that turn
    with its slope. 2e-6 of N and N m are left for the last of the swing."""
    found = cantilever()
    x = found["section_place"]
    v, w = deflection(x)
    tip_v, tip_w = deflection(np.array(ROD.length))
    lever = np.stack([rest(x) * (1.0 + TIP[0] / (ROD.youngs_modulus * AREA)), tip_v - v, tip_w - w], axis=1)
    force = np.array(TIP) - WEIGHT * rest(x)[:, None] * np.array([0.0, 0.0, 1.0])
    moment = np.cross(lever, TIP)
    moment[:, 1] += 0.5 * WEIGHT * rest(x) ** 2
    moment[:, 0] -= WEIGHT * (_area_below(ROD.length) - _area_below(x) - v * rest(x))
    slope_v, slope_w = slopes(x)
    R = Rotation.from_rotvec(np.stack([np.zeros_like(x), -slope_w, slope_v], axis=1)).inv()
    assert found["section_force"] == pytest.approx(R.apply(force), abs=2e-6)
    assert found["section_moment"] == pytest.approx(R.apply(moment), abs=2e-6)


def deflection(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Static deflection along y and z [m]."""
    EI, L = ROD.youngs_modulus * SECOND, ROD.length
    lateral = x**2 * (3.0 * L - x) / (6.0 * EI)
    sag = WEIGHT * x**2 * (6.0 * L**2 - 4.0 * L * x + x**2) / (24.0 * EI)
    return TIP[1] * lateral, TIP[2] * lateral - sag


def slopes(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Static slopes along y and z [rad]."""
    EI, L = ROD.youngs_modulus * SECOND, ROD.length
    lateral = x * (2.0 * L - x) / (2.0 * EI)
    sag = WEIGHT * x * (3.0 * L**2 - 3.0 * L * x + x**2) / (6.0 * EI)
    return TIP[1] * lateral, TIP[2] * lateral - sag


def _area_below(x: Any) -> Any:
    """Integral of the deflection along y from the clamp to x [m^2]."""
    return TIP[1] * (ROD.length * x**3 - x**4 / 4.0) / (6.0 * ROD.youngs_modulus * SECOND)


def test_cantilever_peak_stress_is_that_of_the_outer_fibre() -> None:
    """N/A + M r / I with the resultant moment; shear lifts von Mises by 3 tau^2 / 2 sigma, tau 0.1 MPa."""
    found = cantilever()
    N, M = found["section_force"][:, 0], np.hypot(*found["section_moment"][:, 1:].T)
    expected = N / AREA + M * ROD.radius / SECOND
    assert found["peak_axial_stress"] == pytest.approx(expected, rel=1e-12)
    inner = found["section_place"] < 0.2
    assert np.all(found["peak_von_mises_stress"] >= expected * (1 - 1e-12))
    assert found["peak_von_mises_stress"][inner] == pytest.approx(expected[inner], rel=2e-3)


@pytest.mark.parametrize(
    "reference, count, within",
    # the stretch rho omega^2 L^2 / 3E = 7e-6 is left out; of seven free-free modes none is axial: E A u' of them is
    # zero, and mode acceleration is exact all the same
    [("craig-bampton", 13, 3e-5), ("free-free", 7, 1e-6)],
)
def test_a_spinning_rod_is_pulled_by_what_lies_beyond(reference: str, count: int, within: float) -> None:
    """N = rho A omega^2 (L^2 - x^2) / 2, whatever the modes."""
    spin = {"body.rod.angular_velocity": [0.0, 0.0, SPIN], "load.gravity.acceleration": [0.0, 0.0, 0.0]}
    now = on_a_ball_joint(reference, count, RESTING | spin)
    found, omega = last(now), float(now.angular_velocity.values[-1, 0, 2])
    expected = 0.5 * ROD.density * AREA * omega**2 * (ROD.length**2 - found["section_place"] ** 2)
    assert found["section_force"][:, 0] == pytest.approx(expected, rel=1e-6, abs=within * expected.max())
    assert found["peak_axial_stress"][0] == pytest.approx(expected[0] / AREA, rel=1e-4)


def chimney(x: np.ndarray) -> np.ndarray:
    """My of a rigid rod that falls about its end; thin, it is -(m g / 4) x (1 - x/L)^2, here with rotary inertia."""
    L, line, turn = ROD.length, ROD.density * AREA, ROD.density * SECOND
    alpha = 0.5 * WEIGHT * L**2 / (line * L**3 / 3.0 + turn * L)
    swing = line * ((L**3 - x**3) / 3.0 - 0.5 * x * (L**2 - x**2))
    return 0.5 * WEIGHT * rest(x) ** 2 - alpha * (swing + turn * rest(x))


def test_a_rod_let_go_bends_as_a_falling_chimney() -> None:
    """10 ms after it was let go from the horizontal: damped, it only turns; seven free-free modes.

    It has turned by 3e-3 rad, which enters squared, 5e-6; the rest of 1e-4 is the last of its vibration.
    """
    modes = {"reference": "free-free", "count": 7}
    found = last(run("checks/swinging_rod", RESTING | {"body.rod.modes": modes, "time.end": "10 ms"}))
    expected = chimney(found["section_place"])
    assert found["section_moment"][:, 1] == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


# Balance ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reference, count", [("craig-bampton", 13), ("free-free", 7)])
def test_forces_at_the_ends_are_those_of_the_joints(reference: str, count: int) -> None:
    """At the hinge the joint's force, beyond which the whole rod's inertia was summed; at the free end nothing."""
    found = on_a_ball_joint(reference, count, {})
    scale = float(np.abs(found.joint_force).max())
    size = np.linalg.norm(found.section_force.values[:, 0], axis=1)
    joint = np.linalg.norm(found.joint_force.values[:, 0], axis=1)
    assert np.abs(size - joint).max() <= 1e-8 * scale
    assert np.abs(found.section_moment.values[:, 0]).max() <= 1e-8 * scale * ROD.length
    assert np.abs(found.section_force.values[:, -1]).max() == 0.0


# Rod 1 in the paper's mechanism -------------------------------------------------------------------------------------

PIECES = 12
FINE = 5e-7  #: [s]


def test_section_forces_at_the_interfaces_are_the_joint_forces() -> None:
    """P1 at the lower end, where all of the rod's inertia was summed on the way; the ball's stem at the upper end."""
    far = run("sps4/far_cb", {"time.end": "20 ms"})
    for kind in ("force", "moment"):
        inside = np.linalg.norm(far[f"section_{kind}"].values, axis=2)
        for section, joint in ((0, "P1"), (-1, "fixed_ball_A1")):
            known = np.linalg.norm(far[f"joint_{kind}"].sel(joint=joint).values, axis=1)
            assert np.abs(inside[:, section] - known).max() <= 1e-8 * known.max()


def test_each_piece_is_moved_by_the_forces_at_its_ends() -> None:
    """Axial force against mass times acceleration of each twelfth of the rod, from the recorded motion: the rod's
    centre of mass, its turning, and the modal accelerations as differences of the recorded rates. Those err by
    (omega h)^2 / 6 of the fastest coordinate, 0.1 % at 20 kHz and h = 0.5 us."""
    data = run("sps4/far_cb", {"time.end": 200 * FINE, "output.interval": FINE})
    pull = np.diff(data.section_force.values[:, :, 0].reshape(len(data.time), PIECES, 2), axis=2)[1:-1, :, 0]
    rod = data.sel(body="rod1").isel(time=slice(1, -1))
    R = quaternion_to_matrix(rod["quaternion"].values)
    omega, alpha = rod["angular_velocity"].values[:, None], rod["angular_acceleration"].values[:, None]
    u = data["modal_velocity"].values
    du = (u[2:] - u[:-2]) / (2.0 * FINE)
    reduced = recorded("sps4/far_cb", {})[1]["rod1"]
    # of the middle of each piece against the rod's centre of mass, both per modal coordinate; extension is linear there
    mass = float(reduced["mass"])
    middle = 0.5 * (reduced["shape_translation"].values[1:] + reduced["shape_translation"].values[:-1])
    shape = middle - reduced["modal_first_moment"].values / mass
    place = 0.5 * (reduced["node_position"].values[1:] + reduced["node_position"].values[:-1])
    arm = np.einsum("tij,pj->tpi", R, place - reduced["first_moment"].values / mass)
    bent = np.einsum("tij,pjm,tm->tpi", R, shape, du)
    a = rod["acceleration"].values[:, None] + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm)) + bent
    inertia = mass / PIECES * np.einsum("tpi,ti->tp", a, R[:, :, 0])
    assert np.abs(pull - inertia).max() <= 0.01 * np.abs(inertia).max()
