"""Equilibria and natural vibrations against closed forms, and against the equations of motion run in time."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.dynamics import analyses
from flexclear.dynamics.linear.bench import state
from flexclear.dynamics.linear.equilibrium import bench_in_equilibrium
from flexclear.dynamics.linear.vibrations import vibrations
from flexclear.dynamics.run.trajectory import integrate
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError, SolverError
from flexclear.system.progress import silent
from tests.analytic.beam_models import build, lowest
from tests.analytic.mechanism_runs import TREE, bundles, frequencies
from tests.properties.mechanisms import GRAVITY, Table, joint, rigid

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
    found = analyses.frequencies(scene, bundles(scene), silent)
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
        analyses.frequencies(scene, bundles(scene), silent)


def test_a_falling_body_has_no_equilibrium() -> None:
    with pytest.raises(SolverError, match=r"static equilibrium.*failed.*body box.*restrain that motion"):
        frequencies("checks/free_body")


# Springs, dampers and forces -----------------------------------------------------------------------------------------

MASS, STIFFNESS, COUNT, REST = 0.4, 900.0, 5, 0.1


def vibrations_of(table: dict[str, Any], time: float = 0.0) -> xr.Dataset:
    scene = Scene.model_validate({"title": "test", "time": {"end": 1.0}, **table})
    return analyses.frequencies(scene, bundles(scene), silent, time)


def chain(damping: float) -> dict[str, Any]:
    """Masses on a vertical rail, each hung from the one above by a spring."""
    body: Table = {"ground": {"type": "ground", "frames": {"top": {}}}}
    joints: Table = {}
    load = dict(GRAVITY)
    spring = {"type": "spring-damper", "stiffness": STIFFNESS, "damping": damping, "free_length": REST}
    for k in range(1, COUNT + 1):
        body[f"m{k}"] = rigid(MASS, 1e-3, {"F": {}}, pose={"position": [0.0, 0.0, -REST * k]})
        joints[f"m{k}"] = joint("prismatic", "ground.top", f"m{k}.F")
        above = "ground.top" if k == 1 else f"m{k - 1}.F"
        load[f"spring{k}"] = spring | {"between": [above, f"m{k}.F"]}
    return {"body": body, "joint": joints, "load": load}


@pytest.mark.parametrize("damping", [0.0, 2.0])
def test_a_hanging_chain_of_springs(damping: float) -> None:
    """Fixed above and free below: omega_i = 2 sqrt(k/m) sin((2 i - 1) pi / (4 n + 2)), ratio c omega / (2 k)."""
    found = vibrations_of(chain(damping))
    hung = np.cumsum([REST + MASS * G / STIFFNESS * (COUNT - k) for k in range(COUNT)])
    assert found.position.sel(axis="z").values == pytest.approx(-hung, rel=1e-11)
    i = np.arange(1, COUNT + 1)
    omega = 2.0 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * i - 1) * np.pi / (4 * COUNT + 2))
    assert found.undamped_frequency.values == pytest.approx(omega / (2.0 * np.pi), rel=SMOOTH)
    ratio = 0.5 * damping * omega / STIFFNESS
    assert found.damping_ratio.values == pytest.approx(ratio, rel=SMOOTH, abs=0.0)
    assert found.frequency.values == pytest.approx(omega * np.sqrt(1.0 - ratio**2) / (2.0 * np.pi), rel=SMOOTH)
    assert found.load_force.sel(load="spring1").values == pytest.approx([0.0, 0.0, COUNT * MASS * G], rel=1e-9)


def rotor(rest: str, torque: object = 0.0) -> dict[str, Any]:
    spring = {"type": "joint-spring", "joint": "axle", "stiffness": 50.0, "damping": "60 N m s/rad", "rest": rest}
    return {
        "body": {"ground": {"type": "ground", "frames": {"F": {}}}, "rotor": rigid(1.0, [0.2, 0.2, 0.3], {"G": {}})},
        "joint": {"axle": joint("revolute", "ground.F", "rotor.G")},
        "load": {"spring": spring, "motor": {"type": "joint-force", "joint": "axle", "force": torque}},
    }


def test_a_torsional_spring_turns_a_rotor_beyond_half_a_turn_and_a_strong_damper_lets_it_creep() -> None:
    """From 0 to 500 deg; 0.3 l^2 + 60 l + 50 = 0 has two real roots: no vibration."""
    found = vibrations_of(rotor("500 deg"))
    assert float(found.load_length.sel(load="spring")) == pytest.approx(np.deg2rad(500.0), rel=1e-12)
    roots = np.sort(np.roots([0.3, 60.0, 50.0]))
    assert np.sort(-found.decay_rate.values) == pytest.approx(roots, rel=SMOOTH)
    assert found.frequency.values == pytest.approx([0.0, 0.0], abs=0.0)


def test_loads_are_as_large_as_at_the_time_of_the_pose() -> None:
    law = {"type": "harmonic", "amplitude": [20.0], "frequency": ["3 rad/s"]}
    found = vibrations_of(rotor("0 deg", law), time=0.4)
    assert float(found.load_length.sel(load="spring")) == pytest.approx(20.0 * np.sin(1.2) / 50.0, rel=1e-12)


def becks_column(load: float) -> xr.Dataset:
    """A clamped beam whose tip is pressed along its own end, in units of E I / L^2."""
    unit = 200e9 * np.pi * 0.002**4 / 4.0
    beam = {
        "type": "flexible",
        "mesh": str(TREE / "meshes" / "checks" / "slender_beam.toml"),
        "modes": {"reference": "craig-bampton", "count": 20},
        "stiffening": {},
    }
    push = {"type": "point-force", "frame": "beam.tip", "force": [0.0, 0.0, -load * unit], "axes": "frame"}
    return vibrations_of(
        {
            "body": {"ground": {"type": "ground", "frames": {"wall": {}}}, "beam": beam},
            "joint": {"clamp": joint("fixed", "ground.wall", "beam.root")},
            "load": {"push": push},
        }
    )


def test_a_load_that_follows_the_end_of_a_column_makes_it_flutter_and_never_buckle() -> None:
    """Beck's column: two frequencies meet at 20.0509 E I / L^2; forces without a potential, K is not symmetric.

    Sixteen elements and ten bending shapes per plane meet within 1e-3 of it.
    """
    critical = 20.0509
    below, above = (becks_column(fraction * critical) for fraction in (0.998, 1.002))
    lowest = below.frequency.values[:4]
    # both planes alike; the two frequencies of a plane have nearly met
    assert lowest[0] > 0.0
    assert lowest[3] / lowest[0] < 1.2
    largest = np.abs(above.decay_rate.values).max()
    assert largest > 0.01 * 2.0 * np.pi * above.frequency.values[0]
    assert np.abs(below.decay_rate.values).max() < 1e-3 * largest
    # Euler's load of the same column would be pi^2 / 4: it is far beyond that without falling over
    assert becks_column(10.0).frequency.values.min() > 0.0


@pytest.mark.parametrize("turn", [0.3, 1.1, 2.9])
def test_weights_that_balance_leave_no_stiffness_but_rounding(turn: float) -> None:
    """A balance on an oblique axle: what is left of its weights' moments is neither vibration nor instability."""
    arm = np.array([np.cos(turn), np.sin(turn), 0.0]) / 3.0
    table: dict[str, Any] = {
        "body": {
            "ground": {"type": "ground", "frames": {"F": {"axes": {"z": [1.0, 2.0, 3.0], "x": [3.0, 0.0, -1.0]}}}},
            "beam": rigid(0.3, [0.01, 0.01, 0.02], {"G": {}}),
        },
        "joint": {"axle": {"type": "revolute", "between": ["ground.F", "beam.G"]}},
        "load": GRAVITY,
    }
    for name, mass, end in (("near", 1.1, arm), ("far", 0.7, -1.1 / 0.7 * arm)):
        table["body"]["beam"]["frames"][name] = {"position": end.tolist()}
        table["body"][name] = rigid(mass, 1e-3, {"C": {}})
        table["joint"][name] = {"type": "fixed", "between": [f"beam.{name}", f"{name}.C"]}
    found = vibrations_of(table)
    assert found.attrs["motions_without_stiffness"] == 1
    assert found.frequency.values == pytest.approx([0.0], abs=0.0)
    assert found.decay_rate.values == pytest.approx([0.0], abs=0.0)


def test_a_spring_of_no_length_holds_in_every_direction() -> None:
    """Its ends meet in the equilibrium, where it has no direction."""
    body = rigid(MASS, 1e-3, {"C": {}}, pose={})
    spring = {"type": "spring-damper", "between": ["ground.O", "ball.C"], "stiffness": STIFFNESS, "free_length": 0.0}
    table = {"body": {"ground": {"type": "ground", "frames": {"O": {}}}, "ball": body}, "load": {"s": spring}}
    found = vibrations_of(table).undamped_frequency.values
    omega = np.sqrt(STIFFNESS / MASS)
    assert found[found > 0.0] == pytest.approx(np.full(3, omega / (2.0 * np.pi)), rel=SMOOTH)


# The paper's mechanism with a flexible rod ---------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("number", [4, 6, 7, 9, 12])
def test_a_vibration_let_loose_swings_as_its_frequency_and_shape_say(number: int) -> None:
    """Started with the speeds e w, a quarter period later it stands at e w / omega: for loops, balls and the rod."""
    path = TREE / "scenes" / "sps4" / "far_cb.toml"
    scene = load_scene(path)
    bench, found, _ = bench_in_equilibrium(scene, bundles(scene), silent, 0.09)
    small = vibrations(bench, found.at)
    omega, w = small.value[number].imag, small.shape[:, number].real
    brief = load_scene(path, {"time.end": 0.5 * np.pi / omega, "output.interval": 0.1 * np.pi / omega})
    bench, found, _ = bench_in_equilibrium(brief, bundles(brief), silent, 0.09)
    # far below where the rod's rotations, some 100 rad per unit, or the legs' swing would be of second order
    speed = 1e-6 * omega
    done = integrate(bench.engine, state(bench, found.at.q, speed * w), silent)
    nq, nv = len(found.at.q), len(w)
    moved = done.rows[-1, 1 : 1 + nq] - found.at.q
    known = found.at.moves @ w * speed / omega
    assert moved == pytest.approx(known, abs=1e-4 * np.abs(known).max())
    stopped = done.rows[-1, 1 + nq : 1 + nq + nv]
    # what is of second order in the swing shakes the stiff rod: some 1e-4 of the speed in the slowest vibration
    assert np.abs(stopped).max() < 1e-3 * speed * np.abs(w).max()


def test_the_four_legs_spin_freely_and_nothing_else_does() -> None:
    """A leg turns about the line through its two balls; its flexible rod follows without bending."""
    scene = load_scene(TREE / "scenes" / "sps4" / "far_cb.toml")
    found = analyses.frequencies(scene, bundles(scene), silent, 0.09)
    # 13 modes of the rod, 4 spins; the platform is held by the four drives and the central joints
    assert found.attrs["mobility"] == 17
    assert found.attrs["motions_without_stiffness"] == 4
    free, bound = found.isel(vibration=slice(0, 4)), found.isel(vibration=slice(4, None))
    still = free.frame_translation.sel(frame=[f"platform.A{k}" for k in range(1, 5)])
    assert np.abs(still).max() < 1e-9 * np.abs(free.frame_rotation).max()
    assert float(bound.frequency.min()) > 10.0
    assert found.energy_share.sum("moving_body").values == pytest.approx(np.ones(17), abs=1e-9)
