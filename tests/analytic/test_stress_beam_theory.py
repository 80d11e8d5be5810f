"""Section forces and peak stresses of single rods against beam theory."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.core.scene.load import load_scene
from tests.analytic.beam_solutions import PAPER_ROD as ROD
from tests.analytic.mechanism_runs import TREE
from tests.analytic.stress_runs import bundle, last, run

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


@cache
def hanging(reference: str, count: int) -> xr.Dataset:
    """The rod on a ball joint at x = 0, let go at rest from the horizontal."""
    modes = {"reference": reference, "count": count, "interfaces": ["bottom", "top"]}
    return run("checks/swinging_rod", {"body.rod.modes": modes, "time.end": "20 ms"})


@cache
def spinning(reference: str, count: int) -> xr.Dataset:
    """The rod on a ball joint at x = 0, spinning about the vertical through it, without gravity; damped."""
    modes = {"reference": reference, "count": count, "interfaces": ["bottom", "top"]}
    spin = {
        "body.rod.modes": modes,
        "body.rod.angular_velocity": [0.0, 0.0, SPIN],
        "load.gravity.acceleration": [0.0, 0.0, 0.0],
        "time.end": "20 ms",
    }
    return run("checks/swinging_rod", RESTING | spin)


def scene_rod(reference: str, count: int) -> tuple[str, Any]:
    """Recipe and modes of the rod in `hanging`."""
    modes = {"reference": reference, "count": count, "interfaces": ["bottom", "top"]}
    body = load_scene(TREE / "scenes" / "checks" / "swinging_rod.toml", {"body.rod.modes": modes}).flexible()["rod"]
    return body.mesh, body.modes


def rest(x: np.ndarray) -> np.ndarray:
    return ROD.length - x


# Forces -------------------------------------------------------------------------------------------------------------


def test_cantilever_section_forces_are_those_of_beam_theory() -> None:
    """The force at the tip and the weight beyond each section, with the levers of the deflected rod, in axes that turn
    with its slope. 2e-6 of N and N m are left for the axial stretch (4e-7 m) and the last of the swing."""
    found = cantilever()
    x = found["section_place"]
    v, w = deflection(x)
    tip_v, tip_w = deflection(np.array(ROD.length))
    lever = np.stack([rest(x), tip_v - v, tip_w - w], axis=1)
    force = np.array(TIP) - WEIGHT * rest(x)[:, None] * np.array([0.0, 0.0, 1.0])
    moment = np.cross(lever, TIP)
    moment[:, 1] += 0.5 * WEIGHT * rest(x) ** 2
    moment[:, 0] -= WEIGHT * (_area_below(ROD.length) - _area_below(x) - v * rest(x))
    slope_v, slope_w = slopes(x)
    R = Rotation.from_rotvec(np.stack([np.zeros_like(x), -slope_w, slope_v], axis=1)).inv()
    assert found["section_force"] == pytest.approx(R.apply(force), abs=2e-6)
    assert found["section_moment"] == pytest.approx(R.apply(moment), abs=2e-6)


def _area_below(x: Any) -> Any:
    """Integral of the deflection along y from the clamp to x [m^2]."""
    return TIP[1] * (ROD.length * x**3 - x**4 / 4.0) / (6.0 * ROD.youngs_modulus * SECOND)


def test_cantilever_peak_stress_is_that_of_the_outer_fibre() -> None:
    """sigma = N/A + M r / I with the resultant moment; shear lifts von Mises by 3 tau^2 / 2 sigma, tau 0.1 MPa."""
    found = cantilever()
    N, M = found["section_force"][:, 0], np.hypot(*found["section_moment"][:, 1:].T)
    expected = N / AREA + M * ROD.radius / SECOND
    assert found["peak_axial_stress"] == pytest.approx(expected, rel=1e-12)
    inner = found["section_place"] < 0.2
    assert np.all(found["peak_von_mises_stress"] >= expected * (1 - 1e-12))
    assert found["peak_von_mises_stress"][inner] == pytest.approx(expected[inner], rel=2e-3)


def test_a_spinning_rod_is_pulled_by_what_lies_beyond() -> None:
    """N = rho A omega^2 (L^2 - x^2) / 2; the stretch rho omega^2 L^2 / 3E = 7e-6 and the rates it keeps are left out."""
    now = spinning("craig-bampton", 13)
    found, omega = last(now), float(now.angular_velocity.values[-1, 0, 2])
    x = found["section_place"]
    expected = 0.5 * ROD.density * AREA * omega**2 * (ROD.length**2 - x**2)
    assert found["section_force"][:, 0] == pytest.approx(expected, abs=3e-5 * expected.max())
    assert found["peak_axial_stress"][0] == pytest.approx(expected[0] / AREA, rel=1e-4)


def test_modes_without_extension_still_show_the_pull() -> None:
    """Seven free-free modes have no axial one: E A u' of them is zero, and mode acceleration is exact all the same."""
    now = spinning("free-free", 7)
    omega = float(now.angular_velocity.values[-1, 0, 2])
    found = last(now)
    expected = 0.5 * ROD.density * AREA * omega**2 * (ROD.length**2 - found["section_place"] ** 2)
    assert found["section_force"][:, 0] == pytest.approx(expected, rel=1e-6, abs=1e-6 * expected.max())


def test_a_rod_let_go_bends_as_a_falling_chimney() -> None:
    """Horizontal rod, alpha = 3 g / 2 L: M = -(m g / 4) x (1 - x/L)^2, largest at L/3; rigid at the first instant."""
    first = hanging("craig-bampton", 13).isel(time=0)
    x, m = first["section_place"].values, ROD.density * AREA * ROD.length
    # elastic coordinates start at rest but accelerate: what is rigid in the formula is the mean over the vibration
    mean = hanging("craig-bampton", 13)["section_moment"].sel(axis="y").values
    chimney = -0.25 * m * 9.81 * x * (1.0 - x / ROD.length) ** 2
    middle = np.argmin(np.abs(x - ROD.length / 3.0))
    average = mean[:, middle].mean()
    # the mean of some five vibrations about the quasi-static moment, over which the rod turns by 0.6 deg
    assert average == pytest.approx(chimney[middle], rel=0.1)


# Balance ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reference, count", [("craig-bampton", 13), ("free-free", 7)])
def test_forces_at_the_ends_are_those_of_the_joints(reference: str, count: int) -> None:
    """At the hinge the joint's force, beyond which the whole rod's inertia was summed; at the free end nothing."""
    found = hanging(reference, count)
    scale = float(np.abs(found.joint_force).max())
    size = np.linalg.norm(found.section_force.values[:, 0], axis=1)
    joint = np.linalg.norm(found.joint_force.values[:, 0], axis=1)
    assert np.abs(size - joint).max() <= 1e-8 * scale
    assert np.abs(found.section_moment.values[:, 0]).max() <= 1e-8 * scale * ROD.length
    assert np.abs(found.section_force.values[:, -1]).max() == 0.0


def test_mode_acceleration_beats_the_modal_coordinates_alone() -> None:
    """Moments of seven free-free modes, against those of 25 coordinates with the static answer of the interfaces."""
    best = hanging("craig-bampton", 25)["section_moment"].sel(axis="y").values
    few = hanging("free-free", 7)
    accelerated = few["section_moment"].sel(axis="y").values
    alone = curvature_moments(few["modal_coordinate"].values)
    scale = np.sqrt(np.mean(best**2))
    error, error_alone = (np.sqrt(np.mean((moment - best) ** 2)) / scale for moment in (accelerated, alone))
    assert error < 0.5 * error_alone


def curvature_moments(q: np.ndarray) -> np.ndarray:
    """My = -E I w'' at both ends of every cell, of Hermite cubics through the nodes, shape (time, section)."""
    data = bundle(*scene_rod("free-free", 7))
    w = np.einsum("nm,tm->tn", data["shape_translation"].values[:, 2], q)
    slope = -np.einsum("nm,tm->tn", data["shape_rotation"].values[:, 1], q)
    h, rise = ROD.length / 12, np.diff(w, axis=1)
    start = 6.0 * rise / h**2 - (4.0 * slope[:, :-1] + 2.0 * slope[:, 1:]) / h
    end = -6.0 * rise / h**2 + (2.0 * slope[:, :-1] + 4.0 * slope[:, 1:]) / h
    pairs = np.stack([start, end], axis=2).reshape(len(q), -1)
    return -ROD.youngs_modulus * SECOND * pairs
