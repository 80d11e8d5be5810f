"""The paper's mechanism against second derivations: ideal joints, clearance, and a flexible rod."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from flexclear.numerics.rotations import quaternion_to_matrix, rotation_between
from papers.wang_wang_2019.published import TABLE8
from tests.analytic.mechanism_runs import (
    TREE,
    impacts,
    platform_deviations,
    require_coulomb,
    run,
    second_derivation,
)
from tests.reference import sps4
from tests.reference.clearance_simulation import simulate
from tests.reference.ideal_motion import UP, Motion, ideal, reactions

DOWN = np.array([0.0, 0.0, -9.81])
#: height of the plate's centre of mass above the joint centres in the stacked variant [m]
RAISED = 22.5e-3
#: scene -> gravity and platform of the independent computation
CASES = {
    "sps4/ideal": (np.zeros(3), sps4.platform(sps4.LAYOUT)),
    "sps4/variants/gravity": (DOWN, sps4.platform(sps4.LAYOUT)),
    "sps4/variants/stacked": (np.zeros(3), sps4.platform(sps4.LAYOUT, RAISED, 7.048e-3)),
    "sps4/variants/prismatic_60mm": (np.zeros(3), sps4.platform(sps4.LAYOUT)),
    "sps4/variants/first": (np.zeros(3), sps4.platform(sps4.FIRST)),
}
LAYOUTS = {"sps4/variants/first": sps4.FIRST}
#: a part of the stroke, with some impacts
BRIEFLY = (("time.end", 0.04),)
LEGS = range(1, 5)
every_case = pytest.mark.parametrize("scene", CASES)


@cache
def moved(layout: str) -> list[Motion]:
    """The independent motion at the output times of the ideal scene, by a key of LAYOUTS or ``""``."""
    time = run("sps4/ideal").time.values
    return ideal(LAYOUTS.get(layout, sps4.LAYOUT), time, np.where(time < 0.18, 1, -1))


def motions(scene: str) -> list[Motion]:
    """The independent motion of a scene's layout."""
    return moved(scene if scene in LAYOUTS else "")


def close(found: xr.DataArray, expected: list[np.ndarray], fraction: float) -> bool:
    """Whether vectors agree to a share of the largest one of the run."""
    expected_array = np.array(expected)
    return bool(np.abs(found.values - expected_array).max() <= fraction * np.abs(expected_array).max())


@every_case
def test_pose_is_the_inverse_of_the_leg_lengths_at_every_output(scene: str) -> None:
    dataset = run(scene).sel(body="platform")
    height = RAISED if scene.endswith("stacked") else 0.0
    centre = np.array([m.height * UP + m.rotation @ (height * UP) for m in motions(scene)])
    assert np.abs(dataset.position.values - centre).max() <= 1e-9
    turn = quaternion_to_matrix(dataset["quaternion"].values)
    error = turn @ np.array([m.rotation.T for m in motions(scene)])
    angle = np.linalg.norm(error - np.eye(3), axis=(1, 2)) / np.sqrt(2.0)
    assert angle.max() <= 1e-9


@pytest.mark.parametrize("scene", ["sps4/ideal", "sps4/variants/gravity", "sps4/variants/first"])
def test_speeds_and_accelerations_are_the_known_ones_at_every_output(scene: str) -> None:
    dataset = run(scene).sel(body="platform")
    # the state is projected to the constraints at 1e-13 of its size; rates follow linearly
    assert close(dataset.velocity, [m.speed * UP for m in motions(scene)], 1e-9)
    assert close(dataset.angular_velocity, [m.omega for m in motions(scene)], 1e-9)
    assert close(dataset.acceleration, [m.acceleration * UP for m in motions(scene)], 1e-8)
    assert close(dataset.angular_acceleration, [m.alpha for m in motions(scene)], 1e-8)


@every_case
def test_loops_stay_closed(scene: str) -> None:
    assert run(scene).constraint_error.max() <= 1e-10


@every_case
def test_reactions_and_drive_forces_are_those_of_inverse_dynamics(scene: str) -> None:
    """At every fifth output. Prismatic joints carry the forces across the legs, drives those along them."""
    dataset, moved = run(scene).isel(time=slice(None, None, 5)), motions(scene)[::5]
    known = [reactions(m, *CASES[scene]) for m in moved]
    force = dataset.joint_force
    for k in LEGS:
        assert close(force.sel(joint=f"A{k}"), [r.at_A[k - 1] for r in known], 1e-6)
        assert close(force.sel(joint=f"B{k}"), [r.at_B[k - 1] for r in known], 1e-6)
        found = force.sel(joint=f"P{k}").values
        axes = np.array([m.legs[0][k - 1] for m in moved])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        across = found - np.sum(found * axes, axis=1, keepdims=True) * axes
        expected = np.array([r.across[k - 1] for r in known])
        assert np.abs(across - expected).max() <= 1e-6 * np.abs(expected).max()
    assert close(force.sel(joint="C"), [r.at_C for r in known], 1e-6)
    assert close(force.sel(joint="Z"), [r.at_Z for r in known], 1e-6)
    assert close(dataset.drive_force.sel(drive=[f"P{k}" for k in LEGS]), [r.drive for r in known], 1e-6)


@every_case
def test_spherical_joints_carry_no_moment(scene: str) -> None:
    dataset = run(scene)
    names = [f"{end}{k}" for end in "AB" for k in LEGS] + ["C"]
    # moments of the forces at hand about points centimetres away are some newton metres
    assert np.abs(dataset.joint_moment.sel(joint=names)).max() <= 1e-7


@every_case
def test_legs_do_not_spin(scene: str) -> None:
    dataset = run(scene)
    for k in LEGS:
        axes = np.array([m.legs[0][k - 1] for m in motions(scene)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        for part in ("rod", "cylinder", "ball_A", "ball_B"):
            spin = np.sum(dataset.angular_velocity.sel(body=f"{part}{k}").values * axes, axis=1)
            assert np.abs(spin).max() <= 1e-8


@every_case
def test_energy_ledger_closes(scene: str) -> None:
    dataset = run(scene)
    assert np.abs(dataset.energy_error).max() <= 1e-7 * max(dataset.kinetic.max(), np.abs(dataset.potential).max())


# Clearance at A1, against a derivation in minimal form ---------------------------------------------------------------

#: the first layout: its impacts press ball and socket into each other by less than those of the paper's scenes, so that
#: a vanishing clearance has more decades before that shows
SCENE, IDEAL = "sps4/variants/first_csj", "sps4/variants/first"
#: numbers of the second derivation
KNOWN = second_derivation("csj")
#: a contact short enough for sums over microseconds; the first impact of the run lies in it
CLOSE_UP = (("output.interval", "1 us"), ("time.end", "7.2 ms"))
LEG = ("rod1", "cylinder1", "ball_A1", "ball_B1")


def test_impacts_happen_when_and_as_hard_as_in_the_second_derivation() -> None:
    found = impacts(run(SCENE))
    # the motion is not chaotic: errors of 1e-10 grow some ten times over the run
    assert found["start"] == pytest.approx(KNOWN["impact_start"], abs=1e-7)
    assert found["approach"] == pytest.approx(KNOWN["impact_approach"], abs=1e-5)
    assert found["peak_force"] == pytest.approx(KNOWN["impact_peak_force"], rel=1e-3)
    assert found["separation"][:-1] == pytest.approx(KNOWN["impact_separation"][:-1], abs=1e-5)


def test_platform_moves_as_in_the_second_derivation() -> None:
    dataset = run(SCENE).sel(body="platform").sel(time=KNOWN["time"], method="nearest", tolerance=1e-9)
    assert dataset.position.values[:, 2] == pytest.approx(KNOWN["height"], abs=1e-8)
    assert dataset.velocity.values[:, 2] == pytest.approx(KNOWN["speed"], abs=1e-5)
    turn = quaternion_to_matrix(dataset["quaternion"].values).reshape(-1, 9)
    assert turn == pytest.approx(KNOWN["rotation"], abs=1e-7)


def test_friction_spins_leg_1_as_in_the_second_derivation() -> None:
    dataset = run(SCENE).sel(time=KNOWN["time"], method="nearest", tolerance=1e-9)
    rod = dataset.sel(body="rod1")
    axes = quaternion_to_matrix(rod["quaternion"].values)[..., 2]
    spin = np.sum(rod.angular_velocity.values * axes, axis=1)
    assert spin == pytest.approx(KNOWN["spin"], abs=1e-4)


def test_impulse_of_the_contact_is_the_change_of_angular_momentum() -> None:
    """Leg 1 turns about B1, on which nothing but the contact has a moment."""
    dataset = run(SCENE, CLOSE_UP)
    time = dataset.time.values
    momentum = sum(_angular_momentum(dataset, body) for body in LEG)
    socket = dataset.frame_position.sel(frame="socket_A1.centre").values
    offset = dataset.contact_offset.values[:, 0]
    turned = quaternion_to_matrix(dataset.sel(body="socket_A1")["quaternion"].values)
    world = np.einsum("tij,tj->ti", turned, offset)
    reach = sps4.Contact().ball_radius * world / np.linalg.norm(world, axis=1, keepdims=True).clip(1e-12)
    moment = np.cross(socket + world + reach - sps4.FIRST.B[0], dataset.contact_force.values[:, 0])
    impulse = np.sum(0.5 * (moment[1:] + moment[:-1]) * np.diff(time)[:, None], axis=0)
    pushed = np.linalg.norm(impulse)
    assert pushed > 0.1 * np.linalg.norm(momentum[0] - momentum[-1]) > 0.0
    # trapezia of 1 us on a pulse of 157 us
    assert momentum[-1] - momentum[0] == pytest.approx(impulse, abs=1e-4 * pushed)


def _angular_momentum(dataset: object, body: str) -> np.ndarray:
    """Of one body about B1 [kg m^2/s], from its recorded motion."""
    data = {"rod1": sps4.ROD, "cylinder1": sps4.CYLINDER}.get(body, sps4.BALL)
    motion = dataset.sel(body=body)
    R = quaternion_to_matrix(motion["quaternion"].values)
    inertia = R @ np.diag([data.transverse, data.transverse, data.axial]) @ np.swapaxes(R, 1, 2)
    spin = np.einsum("tij,tj->ti", inertia, motion.angular_velocity.values)
    return spin + data.mass * np.cross(motion.position.values - sps4.FIRST.B[0], motion.velocity.values)


def test_the_scenes_layout_has_table_8s_angle_and_displacement_and_misses_its_velocity() -> None:
    """The two were fitted, by kinematics at the start alone: impacts keep off the extreme by half a per cent or so."""
    angle, place, speed = platform_deviations("sps4/csj", "sps4/ideal")
    assert angle == pytest.approx(TABLE8.angle, rel=0.05)
    assert place == pytest.approx(1e-3 * TABLE8.displacement, rel=0.05)
    # predicted, 70 mm/s where 13.57 are printed: no choice of what else the paper leaves open comes near
    assert speed > 3.0 * 1e-3 * TABLE8.velocity


@pytest.mark.slow
def test_the_second_derivation_gives_its_stored_numbers() -> None:
    """Some minutes: the numbers in csj.json are what the code next to them computes."""
    result = simulate(until=0.0165)
    expected = KNOWN["impact_start"]
    assert [i.start for i in result.impacts] == pytest.approx(expected[: len(result.impacts)], abs=1e-8)
    assert len(result.impacts) == np.sum(expected < 0.0165)
    peaks = [i.peak_force for i in result.impacts]
    assert peaks == pytest.approx(KNOWN["impact_peak_force"][: len(peaks)], rel=1e-6)


# Several clearance joints at once, and clearances that vanish -------------------------------------------------------

BOTH, ALL = "sps4/variants/csj_a1_a2", "sps4/variants/csj_all"
#: radial clearance [m], with the stiffness of 0.5 mm held
CLEARANCES = (5e-4, 1e-4, 2e-5, 5e-6, 1e-6)


def held(clearance: float) -> xr.Dataset:
    return run(SCENE, (("joint.A1.clearance", clearance), ("joint.A1.normal.stiffness", 1.3631e11)))


def angle_error(dataset: xr.Dataset) -> float:
    """Largest rotation of the platform against the ideal mechanism [rad]."""
    ideal = run(IDEAL).sel(body="platform")
    same = dataset.sel(body="platform").sel(time=ideal.time, method="nearest", tolerance=1e-9)
    turned = rotation_between(ideal["quaternion"].values, same["quaternion"].values)
    return float(np.abs(turned).max())


def test_error_against_ideal_falls_with_the_clearance_and_cost_stays_bounded() -> None:
    errors = np.array([angle_error(held(c)) for c in CLEARANCES])
    # what is left at zero clearance is the contact's own compliance: some micrometres at the largest force
    fraction = errors / np.array(CLEARANCES)
    assert fraction[:3] == pytest.approx(fraction[0], rel=0.1)
    assert (np.diff(errors) < 0.0).all()
    cost = [held(c).attrs["evaluations"] for c in CLEARANCES]
    # asked for: three times, between the widest and any other
    assert max(cost) <= 3 * cost[0]


@pytest.mark.parametrize("floor", ["1e-9 m/s", "1e-7 m/s"])
def test_mechanism_does_not_see_the_rate_floor_over_three_decades(floor: str) -> None:
    """1e-9 to 1e-6 m/s, where the slowest impact of the run has some 1e-3."""
    same, known = run(SCENE, (("joint.A1.floor", floor), *BRIEFLY)), run(SCENE, BRIEFLY)
    assert impacts(same)["start"] == pytest.approx(impacts(known)["start"], abs=1e-12)
    assert impacts(same)["approach"] == pytest.approx(impacts(known)["approach"], rel=1e-9)


def test_a_vanishing_clearance_with_stiffness_from_materials_is_warned_of() -> None:
    """Eq. (26) grows as c^-1/2, and the contact's radius with it."""
    assert run(SCENE).attrs["warnings"] == ""
    tight = run(SCENE, (("joint.A1.clearance", 5e-6), ("time.end", "20 ms")))
    assert "the stiffness from radii and materials (Hertz) holds below 0.3" in tight.attrs["warnings"]


@pytest.mark.parametrize("scene, count, near", [(SCENE, 1, 1e-7), (BOTH, 2, 1e-6), (ALL, 5, 1e-6)])
def test_clearance_joints_keep_the_ledger_the_loops_and_the_laws(scene: str, count: int, near: float) -> None:
    dataset = run(scene)
    assert dataset.sizes["contact"] == count
    # a hundred contacts at 1e-10; a thousandth of the tolerance that a run must keep
    assert np.abs(dataset.energy_error).max() <= near * dataset.kinetic.max()
    assert dataset.constraint_error.max() <= 1e-10
    assert dataset.contact_normal_force.min() >= 0.0
    assert (dataset.contact_damping_loss[-1] > 0.0).all()
    require_coulomb(dataset)
    assert (np.diff(dataset.event_time.values) >= 0.0).all()


def test_legs_that_mirror_each_other_hit_at_the_same_time() -> None:
    """Legs 1 and 2 are driven alike; their first closings are simultaneous, and both are found."""
    dataset = run(ALL)
    closings = np.flatnonzero(dataset.event_kind.values == "closing")
    names = dataset.event_contact.values[closings[:2]]
    assert sorted(names) == ["A1", "A2"]
    # mirror images in rounding, and each located to 1e-13 of the clearance at 0.2 m/s
    assert np.diff(dataset.event_time.values[closings[:2]]) == pytest.approx([0.0], abs=1e-12)
    approach = dataset.event_approach_speed.values[closings[:2]]
    assert approach[0] == pytest.approx(approach[1], rel=1e-9)


# The flexible rod, against sums over mass points, and its own rigid limit --------------------------------------------


def test_ideal_joints_platform_and_reaction_are_those_of_the_second_derivation() -> None:
    """A millionth of the deviations from ideal, which are 3e-7 m and 0.7 mm/s, and of the reaction, which rings."""
    known = second_derivation("far_cb")
    dataset = run("sps4/variants/first_far_cb", (("time.end", "20 ms"),))
    found = dataset.sel(time=known["time"], method="nearest", tolerance=1e-9).sel(body="platform", joint="A1")
    assert found.position.values[:, 2] == pytest.approx(known["height"], abs=3e-13)
    assert found.velocity.values[:, 2] == pytest.approx(known["speed"], abs=7e-10)
    assert np.abs(found.joint_force.values - known["force"]).max() <= 1e-6 * np.abs(known["force"]).max()


def test_clearance_first_impacts_are_those_of_the_second_derivation() -> None:
    """Errors grow a thousandfold in a few impacts without damping; the first two are sharp."""
    known, found = second_derivation("far_csj_cb"), impacts(run("sps4/variants/first_far_csj_cb", BRIEFLY))
    first = int(np.sum(known["impact_start"] < 0.0095))
    assert first == 2
    # in flight the modes ring at up to 27 kHz, which the default tolerance follows to some 1e-7 m/s
    assert found["start"][:first] == pytest.approx(known["impact_start"][:first], abs=1e-8)
    assert found["approach"][:first] == pytest.approx(known["impact_approach"][:first], abs=1e-6)
    assert found["separation"][:first] == pytest.approx(known["impact_separation"][:first], abs=5e-6)
    assert found["peak_force"][:first] == pytest.approx(known["impact_peak_force"][:first], rel=1e-4)


def test_fixed_fixed_modes_leave_the_mechanism_ideal_in_pose_and_velocity() -> None:
    """Both joints sit on end nodes, which these modes do not move."""
    ideal = run("sps4/ideal", BRIEFLY).sel(body="platform")
    fixed = run("sps4/far_fixed", BRIEFLY).sel(body="platform").sel(time=ideal.time, method="nearest", tolerance=1e-9)
    assert np.abs(ideal.position.values - fixed.position.values).max() <= 1e-10
    assert np.abs(ideal["quaternion"].values - fixed["quaternion"].values).max() <= 1e-10
    assert np.abs(ideal.velocity.values - fixed.velocity.values).max() <= 1e-10


@pytest.mark.parametrize(
    "scene, near",
    [(f"far_{basis}", 1e-7) for basis in ("free", "fixed", "cb")]
    + [(f"far_csj_{basis}", 1e-6) for basis in ("free", "fixed", "cb")],
)
def test_energy_ledger_of_a_flexible_rod_closes(scene: str, near: float) -> None:
    dataset = run(f"sps4/{scene}", BRIEFLY)
    assert np.abs(dataset.energy_error).max() <= near * dataset.kinetic.max()
    assert dataset.constraint_error.max() <= 1e-10
    if "csj" in scene:
        assert len(impacts(dataset)["start"]) > 3
        assert dataset.contact_friction_power.max() <= 0.0


def rigid_swing(time: np.ndarray) -> np.ndarray:
    """Upper end of the rod of scenes/checks/swinging_rod if it were rigid, (time, 3) [m]."""
    length, radius = 0.24, 0.01
    pull = 9.81 * 0.5 * length / (length**2 / 3.0 + radius**2 / 4.0)

    def rhs(_: float, y: np.ndarray) -> list[float]:
        return [y[1], pull * np.cos(y[0])]

    angle = solve_ivp(rhs, (0.0, time[-1]), [0.0, 0.0], "DOP853", t_eval=time, rtol=1e-12, atol=1e-14).y[0]
    return length * np.column_stack([np.cos(angle), 0.0 * angle, -np.sin(angle)])


def test_swinging_rod_swings_as_a_rigid_one_but_for_its_bending() -> None:
    dataset = run("checks/swinging_rod")
    top = dataset.frame_position.sel(frame="rod.top").values
    # gravity across the rod bends it by some tenths of a micrometre
    bending = np.abs(top - rigid_swing(dataset.time.values)).max()
    assert 1e-8 < bending < 2e-6
    assert np.abs(dataset.energy_error).max() <= 1e-7 * np.abs(dataset.kinetic).max()


def test_swinging_rod_does_not_depend_on_the_reference_condition(tmp_path: Path) -> None:
    """Complete bases under two conditions describe one rod, here one of four elements."""
    mesh = tmp_path / "rod.toml"
    mesh.write_text((TREE / "meshes/actuated_rod.toml").read_text().replace("elements = 12", "elements = 4"))
    short = (("time.end", "2 ms"), ("body.rod.mesh", str(mesh)), ("body.rod.modes.count", 24))
    held = run("checks/swinging_rod", short)
    free = run(
        "checks/swinging_rod",
        (*short, ("body.rod.modes.reference", "free-free"), ("body.rod.modes.interfaces", None)),
    )
    tops = [d.frame_position.sel(frame="rod.top").values for d in (held, free)]
    bending = np.abs(tops[0] - rigid_swing(held.time.values)).max()
    assert np.abs(tops[0] - tops[1]).max() <= 1e-3 * bending
