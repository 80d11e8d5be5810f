"""Section forces and stresses of rods: maps of sections against closed forms, rods and their motion against theory."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from flexclear.dynamics.record.stress import Motion, _turn, peak_stresses, section_forces
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import load_scene
from flexclear.stages.graph import Graph
from flexclear.structure.fe import section as sections
from flexclear.structure.modes import bundle
from flexclear.structure.modes.solution import solve
from flexclear.structure.stress.beam import Outline, _axial, outline, recover
from flexclear.system.errors import InputError
from tests.analytic.beam_models import GENERAL, build
from tests.analytic.beam_solutions import PAPER_ROD as ROD
from tests.analytic.mechanism_runs import run_with_sections as run
from tests.analytic.mechanism_runs import with_sections

NU = 0.33
R, HOLE, WIDTH, HEIGHT = 0.010, 0.006, 0.02, 0.03
CIRCLE, TUBE, BLOCK = sections.circle(R), sections.tube(R, HOLE), sections.rectangle(WIDTH, HEIGHT)
N, QY, QZ, T, MY, MZ = range(6)


def maps(name: str, given: sections.Section) -> Outline:
    found = outline((name,), given, NU)
    assert found is not None
    return found


def peaks(found: Outline, forces: list[float]) -> tuple[float, float]:
    """Largest axial and von Mises stress of one section under N, Qy, Qz, T, My, Mz."""
    data = xr.Dataset(
        {
            "fibre_stress": (("section", "fibre", "stress", "section_load"), found.stress[None]),
            "section_round": (("section",), np.array([found.round], dtype=np.int8)),
        }
    )
    axial, mises, _ = peak_stresses(data, np.array(forces)[None, None])
    return float(axial[0, 0]), float(mises[0, 0])


@pytest.mark.parametrize("nudge", [-1.0, 1.0])
def test_rounding_does_not_choose_between_tension_and_compression(nudge: float) -> None:
    """Two fibres at the same distance from the axis are stretched and pressed alike."""
    fibres = np.zeros((1, 2, 3, 6))
    fibres[0, :, 0, 4] = -1e6, 1e6 * (1.0 + nudge * np.finfo(float).eps)
    data = xr.Dataset(
        {
            "fibre_stress": (("section", "fibre", "stress", "load"), fibres),
            "section_round": (("section",), np.zeros(1, dtype=np.int8)),
        }
    )
    axial, _, _ = peak_stresses(data, np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0])[None, None])
    assert axial[0, 0] == pytest.approx(-2e6, rel=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.234, 2.9])
@pytest.mark.parametrize("pull", [300.0, -300.0])
def test_bending_of_a_round_rod_peaks_at_M_r_over_I_in_any_plane(pull: float, angle: float) -> None:
    """Exact, not to the spacing of fibres; pressure is shown by its sign."""
    moment = 12.0
    forces = [pull, 0.0, 0.0, 0.0, moment * np.cos(angle), moment * np.sin(angle)]
    expected = 300.0 / CIRCLE.area + moment * R / CIRCLE.second_y
    axial, mises = peaks(maps("circle", CIRCLE), forces)
    assert (axial, mises) == pytest.approx((np.sign(pull) * expected, expected), rel=1e-13)


def test_a_rectangle_peaks_at_its_corner() -> None:
    axial, _ = peaks(maps("rectangle", BLOCK), [0.0, 0.0, 0.0, 0.0, 7.0, 5.0])
    expected = 7.0 * 0.5 * HEIGHT / BLOCK.second_y + 5.0 * 0.5 * WIDTH / BLOCK.second_z
    assert axial == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name, given", [("circle", CIRCLE), ("tube", TUBE)])
def test_torsion_of_a_round_section_is_T_r_over_J(name: str, given: sections.Section) -> None:
    _, mises = peaks(maps(name, given), [0.0, 0.0, 0.0, 4.0, 0.0, 0.0])
    assert mises == pytest.approx(np.sqrt(3.0) * 4.0 * R / given.torsion, rel=1e-13)


def test_axial_stress_has_the_normal_force_and_the_bending_moments_as_its_resultants() -> None:
    """N = int s dA, My = int z s dA, Mz = -int y s dA, each of a force alone; the others are none."""
    middles = (np.arange(100) + 0.5) / 100 - 0.5
    y, z = (values.ravel() for values in np.meshgrid(WIDTH * middles, HEIGHT * middles))
    stress = _axial(BLOCK, y, z)[:, 0] * (WIDTH * HEIGHT / y.size)
    known = np.zeros((3, 6))
    known[0, N] = known[1, MY] = known[2, MZ] = 1.0
    # sums over 100 by 100 squares: 1e-4 of the second moments
    assert np.stack([np.ones(y.size), z, -y]) @ stress == pytest.approx(known, abs=1.01e-4)


def test_sections_turn_by_their_rotation_vectors() -> None:
    vectors = np.array([[[0.0, 0.0, 0.0], [0.3, -1.2, 0.4]], [[1e-9, 0.0, 2e-9], [2.0, 1.0, -0.5]]])
    known = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(2, 2, 3, 3)
    assert _turn(vectors) == pytest.approx(known, abs=1e-15)  # rounding


def test_torsion_of_a_square_peaks_at_4_8_T_over_a_cubed() -> None:
    """Timoshenko & Goodier, table of sec. 109: 1 / 0.208 with three digits; more digits: 4.8039."""
    square = sections.square(0.02)
    _, mises = peaks(maps("rectangle", square), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    # 200 terms of 1/n^2 leave a thousandth of the series' last term at the middle of a side
    assert mises / np.sqrt(3.0) == pytest.approx(4.8039 / 0.02**3, rel=2e-3)


def test_shear_of_a_circle_is_St_Venants() -> None:
    """Centre and ends of the diameter across: (3 + 2 nu) / 8(1 + nu) and (1 + 2 nu) / 4(1 + nu) times Q r^2 / I."""
    found = maps("circle", CIRCLE).stress
    scale = R**2 / CIRCLE.second_y
    assert found[-1, 2, QZ] == pytest.approx((3 + 2 * NU) / (8 * (1 + NU)) * scale, rel=1e-13)
    assert found[0, 2, QZ] == pytest.approx((1 + 2 * NU) / (4 * (1 + NU)) * scale, rel=1e-13)


@pytest.mark.parametrize("name, given, rings", [("circle", CIRCLE, (R,)), ("tube", TUBE, (R, HOLE))])
def test_round_outlines_carry_no_shear_across_themselves(
    name: str, given: sections.Section, rings: tuple[float, ...]
) -> None:
    found = maps(name, given).stress
    angle = 2.0 * np.pi * np.arange(72) / 72
    for k in range(len(rings)):
        ring = found[72 * k : 72 * (k + 1)]
        across = ring[:, 1] * np.cos(angle)[:, None] + ring[:, 2] * np.sin(angle)[:, None]
        assert np.abs(across[:, [QY, QZ, T]]).max() <= 1e-12 * np.abs(ring[:, 1:, [QY, QZ, T]]).max()


@pytest.mark.parametrize("hole", [0.0, HOLE])
def test_shear_of_a_round_section_sums_to_its_force(hole: float) -> None:
    """Midpoint rule on rings made of the maps of thin tubes would hide the hole; so fibres of the solution itself."""
    from flexclear.structure.stress.beam import _flexure

    n = 200
    r = hole + (np.arange(n) + 0.5) / n * (R - hole)
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    y, z = (np.outer(r, f(angle)).ravel() for f in (np.cos, np.sin))
    area = np.repeat(r, n) * (R - hole) / n * 2.0 * np.pi / n
    second = (TUBE if hole else CIRCLE).second_z
    along, across = _flexure(y, z, R, hole, NU, second)
    # second order in 1/200
    assert area @ along == pytest.approx(1.0, abs=2e-5)
    assert area @ across == pytest.approx(0.0, abs=1e-12)


# Rods ---------------------------------------------------------------------------------------------------------------


def reduced(**changes: Any) -> xr.Dataset:
    grid = build(**changes)
    found = solve(grid, "craig-bampton", 6)
    return bundle.build(grid, found, recover(grid, found, {}))


def test_a_tapered_tube_knows_its_end_sections() -> None:
    """Radii at the ends of the rod, from areas and second moments at Gauss points inside the cells."""
    thick = {"type": "tube", "radius": 0.02, "inner_radius": 0.01}
    thin = {"type": "tube", "radius": 0.01, "inner_radius": 0.004}
    found = reduced(section=thick, end_section=thin)
    for section, radius, hole in ((0, 0.02, 0.01), (-1, 0.01, 0.004)):
        bend = found["fibre_stress"].values[section, 0, 0, MZ]
        assert -bend == pytest.approx(radius / sections.tube(radius, hole).second_z, rel=1e-10)


def test_a_general_section_has_forces_but_no_stresses() -> None:
    found = reduced(section=GENERAL)
    assert "section_place" in found
    assert "fibre_stress" not in found


def test_a_lumped_mass_shows_as_a_jump() -> None:
    """1 kg in the middle, 10 mm next to the axis, pushed along the rod: N jumps by m a, Mz by m a times the arm."""
    lump = {"x": 0.12, "mass": 1.0, "com": [0.0, 0.01, 0.0], "inertia": [1e-4, 1e-4, 1e-4]}
    found = reduced(masses={"ball": lump})
    none, still, flat = np.zeros((1, 2, 3)), np.zeros((1, 3)), np.zeros((1, 6))
    motion = Motion(np.array([[5.0, 0.0, 0.0]]), still, still, flat, flat, flat)
    before, after = section_forces(found, motion, none, none)[0, 11:13]
    assert found["section_place"].values[[11, 12]] == pytest.approx([0.12, 0.12])
    assert before[0] - after[0] == pytest.approx(-5.0, rel=1e-12)
    assert before[5] - after[5] == pytest.approx(5.0 * 0.01, rel=1e-12)


# Scenes -------------------------------------------------------------------------------------------------------------


def clamped(root: Path, changes: dict[str, Any]) -> Graph:
    return Graph(load_scene(root / "scenes" / "checks" / "clamped_rod.toml", changes), shown=False)


def test_absent_means_not_in_any_key(root: Path) -> None:
    """No parameters of the tasks speak of stresses unless the scene does."""
    without, asked = clamped(root, {}), clamped(root, {"output.stress": ["rod"]})
    for graph, there in ((without, False), (asked, True)):
        bundles, simulate = graph.bundle["rod"], graph.simulate
        assert ("stress" in bundles.params) is there
        assert ("stress" in simulate.params["scene"]["output"]) is there


@pytest.mark.parametrize("names", [["wall"], ["rod", "ground"], []])
def test_only_flexible_bodies_have_sections(root: Path, names: list[str]) -> None:
    with pytest.raises(InputError, match="output") as caught:
        clamped(root, {"output.stress": names})
    assert names == [] or names[-1] in str(caught.value)


def test_matrices_alone_are_refused_with_the_place(root: Path, tmp_path: Path) -> None:
    recipe = tmp_path / "part.toml"
    recipe.write_text('[shape]\ntype = "matrices"\n')
    graph = clamped(root, {"output.stress": ["rod"], "body.rod.mesh": str(recipe)})
    with pytest.raises(InputError, match=r"\[output\] stress.*matrices"):
        graph.up_to("bundle")


# Single rods at rest and in motion, and the paper's by its joints ----------------------------------------------------

AREA, SECOND = np.pi * ROD.radius**2, np.pi * ROD.radius**4 / 4.0
WEIGHT = ROD.density * AREA * 9.81  #: [N/m]
TIP = (40.0, 30.0, -50.0)  #: force at the tip [N]
SPIN = 100.0  #: [rad/s]
#: overdamped, a rod comes to rest: the slowest motion falls by exp(-30) in 20 ms
RESTING = {"body.rod.damping": 1.0}


def last(dataset: xr.Dataset) -> dict[str, Any]:
    """Forces, moments and peaks of every section at the last time, with the places of the sections."""
    now = dataset.isel(time=-1)
    names = ("section_place", "section_force", "section_moment", "peak_axial_stress", "peak_von_mises_stress")
    return {name: now[name].values for name in names}


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
    reduced = with_sections("sps4/far_cb", {})[1]["rod1"]
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
