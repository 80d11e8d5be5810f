"""Equilibria and natural frequencies with closed forms."""

from pathlib import Path

import numpy as np
import pytest

from flexclear.pipeline.core.scene.load import load_scene
from flexclear.pipeline.core.system.errors import InputError, SolverError
from flexclear.pipeline.dynamics import analyses
from tests.analytic.beam_models import build, lowest
from tests.analytic.mechanism_runs import TREE, bundles, frequencies

G = 9.81
#: rounding of some hundred products
SMOOTH = 1e-12


def hertz(omega_squared: float | np.ndarray) -> np.ndarray:
    return np.sqrt(omega_squared) / (2.0 * np.pi)


def test_a_pendulum_released_from_the_horizontal_settles_below_its_hinge() -> None:
    found = frequencies("checks/pendulum")
    assert found.position.sel(body="bob").values == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)
    assert found.joint_force.sel(joint="hinge").values == pytest.approx([0.0, G, 0.0], abs=1e-12)
    assert found.frequency.values == pytest.approx([hertz(G)], rel=SMOOTH)
    assert found.attrs["residual"] < 1e-10
    assert found.attrs["mobility"] == 1


def test_an_inverted_pendulum_is_in_balance_and_falls() -> None:
    """Exactly upright it stays where it is put; exp(sqrt(g/l) t) is its small motion."""
    found = frequencies("checks/pendulum", (("body.bob.com", (0.0, 1.0, 0.0)),))
    assert found.position.sel(body="bob").values == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert found.frequency.values == pytest.approx([0.0], abs=0.0)
    assert found.decay_rate.values == pytest.approx([-np.sqrt(G)], rel=SMOOTH)


def test_a_bar_on_two_rods_swings_and_turns_as_its_tensions_say() -> None:
    """Lagrange's equations with rods m, bar M, length l, half width b; the loop's forces are the only stiffness."""
    m, M, l, b, J = 0.5, 2.0, 0.4, 0.3, 0.06
    swing = (M + m) * G / (l * (M + 2.0 * m / 3.0))
    turn = (M + m) * G * b**2 / l / (J + 2.0 * m * b**2 / 3.0)
    found = frequencies("checks/bifilar_pendulum")
    assert found.attrs["mobility"] == 6
    assert found.attrs["motions_without_stiffness"] == 3
    # an exact closed loop: the inertia in the file is rounded to 16 digits
    assert found.frequency.values[:3] == pytest.approx(0.0, abs=0.0)
    assert found.frequency.values[3:] == pytest.approx(np.sort(hertz(np.array([swing, swing, turn]))), rel=SMOOTH)
    turning = found.isel(vibration=-1)
    shape = turning.frame_translation.sel(part="real").sel(frame=["bar.left", "bar.right"]).values
    assert shape[0] == pytest.approx(-shape[1], abs=1e-9)
    # unit modal mass: J + 2/3 m b^2 turns with the angular speed 1/sqrt of it
    turned = abs(float(turning.frame_rotation.sel(part="real", frame="bar.left", axis="z")))
    assert turned == pytest.approx((J + 2.0 * m * b**2 / 3.0) ** -0.5, rel=1e-9)
    assert turning.energy_share.sum() == pytest.approx(1.0, abs=1e-12)
    assert float(turning.energy_share.sel(moving_body="bar")) == pytest.approx(J / (J + 2 * m * b**2 / 3), rel=1e-9)


def test_a_ball_settles_on_the_floor_of_its_socket_and_vibrates_on_it() -> None:
    """Depth (m g / K)^(2/3); 1.5 m g / depth upright, m g / (c + depth) sideways, no friction.

    The numbers are those of an independent computation, m = 0.36 kg, K = 1.363069946913285e11 N/m^1.5, c = 0.5 mm.
    """
    found = frequencies("checks/socket_swing")
    assert found.contact_penetration.values == pytest.approx([8.755929250633222e-08], rel=1e-6)
    assert found.position.sel(body="ball").values[:2] == pytest.approx([0.0, 0.0], abs=1e-13)
    assert found.contact_normal_force.values == pytest.approx([0.36 * G], rel=1e-9)
    assert found.attrs["motions_without_stiffness"] == 3  # it spins freely
    # rounding of a position in 0.5 mm moves a depth of 88 nm by some 1e-12
    assert found.frequency.values[3:] == pytest.approx([22.291105636513862] * 2 + [2063.23712159149], rel=1e-7)


def test_a_clamped_rod_sags_and_vibrates_as_a_cantilever(tmp_path: Path) -> None:
    """One of four elements, with all coordinates of the mesh."""
    mesh = tmp_path / "rod.toml"
    mesh.write_text((TREE / "meshes/actuated_rod.toml").read_text().replace("elements = 12", "elements = 4"))
    found = frequencies("checks/clamped_rod", (("body.rod.mesh", str(mesh)), ("body.rod.modes.count", 24)))
    length, E, inertia, line = 0.24, 7.17e10, np.pi * 1e-8 / 4.0, 2740.0 * np.pi * 1e-4
    sag = line * G * length**4 / (8.0 * E * inertia)
    drop = found.frame_position.sel(frame="rod.top", axis="z") - found.frame_position.sel(frame="rod.bottom", axis="z")
    # cubic elements have the exact tip deflection of a uniform load; the load of linear shapes turns with it, u^2/L^2
    assert float(drop) == pytest.approx(-sag, rel=1e-7)
    # a horizontal sag of 3e-5 lengths couples bending and stretching a little
    known = lowest(build(elements=4), "012345", "", 6)
    assert np.sort(found.frequency.values)[:6] == pytest.approx(known, rel=1e-6)


def test_unit_modal_mass_and_tip_shape_of_the_first_bending_vibration() -> None:
    """The tip of a cantilever moves by 2/sqrt(mass) in every bending mode of Euler and Bernoulli."""
    found = frequencies("checks/clamped_rod")
    tip = found.frame_translation.sel(frame="rod.top", part="real").isel(vibration=0)
    mass = 2740.0 * np.pi * 1e-4 * 0.24
    # rotary inertia of the rod takes (r pi / 2 L)^2, some 1e-3
    assert np.linalg.norm(tip.values) * np.sqrt(mass) == pytest.approx(2.0, rel=3e-3)


@pytest.mark.parametrize(
    "damping",
    [0.02, {"alpha": 30.0, "beta": 1e-6}, {"ratios": [0.01 * (k + 1) for k in range(13)]}],
    ids=["one ratio", "Rayleigh", "ratio per mode"],
)
def test_damping_of_a_clamped_rod_is_that_of_its_modes(damping: object) -> None:
    """Clamped where its basis is, the rod vibrates in its own coordinates; without gravity exactly so."""
    still = ("load.gravity.acceleration", (0.0, 0.0, 0.0))
    free = frequencies("checks/clamped_rod", (still,)).frequency.values
    path = TREE / "scenes" / "checks" / "clamped_rod.toml"
    scene = load_scene(path, {"body.rod.damping": damping, still[0]: still[1]})
    found = analyses.frequencies(scene, bundles(scene), lambda fraction, text: None)
    omega = 2.0 * np.pi * free
    if isinstance(damping, float):
        ratio = np.full(13, damping)
    elif "alpha" in damping:
        ratio = 0.5 * (damping["alpha"] / omega + damping["beta"] * omega)
    else:
        ratio = np.array(damping["ratios"])
    # pairs of equal frequency may come in either order
    order = np.lexsort((found.damping_ratio.values, np.round(found.undamped_frequency.values, 6)))
    assert found.damping_ratio.values[order] == pytest.approx(ratio, rel=1e-8)
    assert found.undamped_frequency.values[order] == pytest.approx(free, rel=1e-8)


def test_ratios_that_are_not_one_per_mode_are_refused() -> None:
    path = TREE / "scenes" / "checks" / "clamped_rod.toml"
    scene = load_scene(path, {"body.rod.damping": {"ratios": [0.01, 0.01]}})
    with pytest.raises(InputError, match=r"2 damping ratios are given for 13 modes"):
        analyses.frequencies(scene, bundles(scene), lambda fraction, text: None)


def test_a_falling_body_has_no_equilibrium() -> None:
    with pytest.raises(SolverError, match=r"static equilibrium.*failed.*body box.*hold that motion"):
        frequencies("checks/free_body")
