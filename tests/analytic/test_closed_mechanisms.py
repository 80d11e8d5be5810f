"""Closed mechanisms against derivations of their own, those whose loops repeat their conditions, and tried ones."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from flexclear.dynamics import analyses
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from tests.analytic.change_points import elbow
from tests.analytic.mechanism_runs import TREE, frequencies, run
from tests.properties import movable
from tests.properties.mechanisms import Table, simulate, simulated
from tests.properties.movable import Mechanism, Random, Setting
from tests.properties.movable_units import UNITS, seed
from tests.reference import flexible_slider_crank
from tests.reference.loose_bodies import SIZE, LooseBodies

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


# Scenes that were tried from outside ---------------------------------------------------------------------------------


def tried(name: str, **override: object) -> xr.Dataset:
    return simulated(load_scene(TREE / "tests" / "reference" / "tried" / f"{name}.toml", override))


@pytest.mark.parametrize("name", ["oblique_door", "upright_door"])
def test_a_door_on_two_hinges_is_movable_and_stays_at_rest(name: str) -> None:
    run = tried(name)
    assert run.attrs["redundant_closure_rows"] == 5
    assert np.abs(run.angular_velocity.values).max() == 0.0


@pytest.mark.slow
def test_a_four_bar_with_a_loose_pin_follows_its_ideal_twin_within_the_clearance() -> None:
    run = tried("loose_four_bar", **{"time.end": "0.1 s"})
    rocker = [elbow(10.0 * t, 1.0, (0.1, 0.3, 0.2, 0.3))[1] for t in run.time.values]
    away = np.abs(run.joint_position.sel(coordinate="D").values - np.unwrap(rocker))
    reach = 2e-4 + float(run.contact_penetration.max())
    assert np.linalg.norm(run.contact_offset.values, axis=2).max() <= reach * (1.0 + 1e-9)
    # the angle between coupler and rocker stays above 0.7 rad, whose sine 0.6 divides
    assert away.max() < reach / 0.2 / 0.6


@pytest.mark.slow
def test_a_door_on_two_loose_pins_swings_as_a_pendulum_within_the_clearance() -> None:
    """About y: J theta'' = -m g r cos(theta), theta above the horizontal; it falls against its first direction."""
    run = tried("door_on_loose_pins", **{"time.end": 0.4})
    mass, gravity = 20.0, 9.81
    start = np.array([0.3745316710276178, -0.14044937663535667])
    arm, about = np.linalg.norm(start), 2.0 + mass * float(start @ start)
    known = solve_ivp(
        lambda t, y: [y[1], -mass * gravity * arm / about * np.cos(y[0])],
        (0.0, 0.4), [np.arctan2(start[1], start[0]), 0.0], t_eval=run.time.values, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    ideal = arm * np.stack([np.cos(known.y[0]), np.sin(known.y[0])], axis=1)
    way = np.linalg.norm(run.position.sel(body="door").values[:, [0, 2]] - ideal, axis=1)
    # the hinge is up to a clearance of 0.1 mm off, and what impacts do to the angle is of that size
    assert way.max() < 1e-3


# Loops that ask for the same thing several times, some of them for nothing else --------------------------------------

#: units whose tree has hinges alone, so that they share their kernels
HINGED = (
    "revolute and revolute", "revolute and cylindrical", "revolute and spherical", "revolute and planar", "five hinges",
    "four-bar", "Watt's six-bar", "eight-bar", "three parallel cranks", "Peaucellier", "spherical four-bar", "Sarrus",
    "Sarrus on five walls", "Bennett", "Bricard with a line", "Bricard with a plane",
)  # fmt: skip
#: those that SciPy's derivation knows, and that have no contact
OTHERS = tuple(name for name in UNITS if name not in HINGED and "clearance" not in name and "loose" not in name)


def hung_up(made: Mechanism, random: Random, setting: Setting, **solver: object) -> Table:
    """The scene of a mechanism under gravity, for the time in which a stone falls an eighth of its size."""
    end = 0.5 * np.sqrt(setting.size / G)
    return movable.scene(
        made, random, setting, time={"end": end}, output={"interval": end / 8.0}, solver={"rtol": 1e-11, **solver},
        load={"gravity": {"type": "gravity", "acceleration": [0.0, 0.0, -G]}},
    )  # fmt: skip


def known_accelerations(table: Table, dataset: xr.Dataset, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations of centres and of turns at all rows, (time, body, 3), by the derivation in maximal coordinates.

    table: the mechanism in metres.  dataset: its run at the given size, where all times are as the root of it.
    """
    bodies, pace = LooseBodies(table), np.sqrt(size)
    names = [name for name, body in table["body"].items() if body["type"] == "rigid"]
    linear, angular = [], []
    for k in range(dataset.sizes["time"]):
        row = dataset.isel(time=k)
        state = []
        for name in names:
            body = row.sel(body=name)
            state += [*body.position.values / size, *body["quaternion"].values]
            state += [*body.velocity.values / pace, *body.angular_velocity.values * pace]
        rates = bodies.rates(np.array(state), []).reshape(len(names), SIZE)
        linear.append(rates[:, 7:10])
        angular.append(rates[:, 10:] / size)
    return np.array(linear), np.array(angular)


def moves_as_derived(made: Mechanism, number: int) -> None:
    """Of any place, size and order of parts, a mechanism moves as a second derivation says, and keeps its energy."""
    random = np.random.default_rng([number, 5])
    setting = replace(movable.any_setting(random), own_frames=True)
    setting = replace(setting, p=tuple(np.clip(setting.p, -3.0, 3.0)))
    dataset = simulate(hung_up(made, np.random.default_rng(number), setting))
    known = hung_up(made, np.random.default_rng(number), replace(setting, size=1.0))
    names = [name for name in known["body"] if name != movable.WORLD]
    linear, angular = known_accelerations(known, dataset, setting.size)
    found = dataset.sel(body=names)
    # the states are closed to 1e-14 of the size, of which poses of small independence leave 1e-10 in the equations
    assert np.abs(found.acceleration.values - linear).max() < 1e-8 * G, made.name
    assert np.abs(found.angular_acceleration.values - angular).max() < 1e-8 * G / setting.size, made.name
    mass = sum(known["body"][name]["mass"] for name in names) * setting.size**3
    # rtol 1e-11 per step, some dozens of them
    assert np.abs(dataset.energy_error.values).max() < 1e-9 * mass * G * setting.size, made.name
    assert float(dataset.constraint_error.max()) < 1e-10 * max(1.0, setting.size), made.name
    assert set(dataset.mobility.values) == {made.mobility}


@pytest.mark.parametrize("name", HINGED)
def test_hinged_mechanisms_accelerate_as_a_second_derivation_says(name: str) -> None:
    made = UNITS[name](np.random.default_rng(seed(name)))
    moves_as_derived(made, sum(seed(name)))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_all_other_mechanisms_accelerate_as_a_second_derivation_says(name: str) -> None:
    made = UNITS[name](np.random.default_rng(seed(name)))
    moves_as_derived(made, sum(seed(name)))


@pytest.mark.parametrize("number", range(3))
def test_closures_that_hold_nothing_do_not_disturb_those_that_do(number: int) -> None:
    """Doors, loops and linkages in one mechanism: some closures keep no row, some a few."""
    random = np.random.default_rng(number)
    names = ["five hinges", "four-bar", *random.choice(HINGED, 2)]
    moves_as_derived(movable.together(random, [UNITS[name](random) for name in names]), number)


def test_peaucelliers_point_moves_on_a_line() -> None:
    """The line is normal to x of the unit; it is reached through eight links and ten hinges."""
    made = UNITS["Peaucellier"](np.random.default_rng(1))
    turn = movable.any_turn(np.random.default_rng(2))
    dataset = simulate(hung_up(made, np.random.default_rng(3), Setting(R=turn, own_frames=True)))
    frame = next(f for f in dataset.frame.values if f.endswith("pin8_a"))
    path = dataset.frame_position.sel(frame=frame).values @ turn
    # closures are kept to 1e-14 of a metre
    assert np.ptp(path[:, 0]) < 1e-12
    assert np.ptp(path[:, 1]) > 0.005


class Door:
    """The pendulum that scenes/checks/door.toml describes."""

    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    mass, inertia, arm = 2.0, 0.2, np.array([0.4, 0.0, 0.0])

    def __init__(self) -> None:
        across = np.eye(3) - np.outer(self.axis, self.axis)
        out, down = across @ self.arm, across @ np.array([0.0, 0.0, -G])
        self.distance, self.pull = float(np.linalg.norm(out)), float(np.linalg.norm(down))
        self.start = float(np.arctan2(self.axis @ np.cross(down, out), down @ out))
        self.about_axis = self.inertia + self.mass * self.distance**2
        self.pace = float(np.sqrt(self.mass * self.pull * self.distance / self.about_axis))

    def angle(self, t: np.ndarray) -> np.ndarray:
        """From where it hangs, let go at rest: sin(angle/2) = k cd(pace t, k), k = sin(start/2)."""
        k = np.sin(0.5 * self.start)
        _, cn, dn, _ = ellipj(self.pace * t, k * k)
        return 2.0 * np.arcsin(k * cn / dn)


def test_a_door_on_two_hinges_swings_as_a_pendulum() -> None:
    door, dataset = Door(), run("checks/door", (("solver.rtol", 1e-12),))
    time = dataset.time.values
    assert time[-1] > 4.0 * ellipk(np.sin(0.5 * door.start) ** 2) / door.pace  # more than a period
    for name in ("low", "high"):
        found = dataset.joint_position.sel(coordinate=name).values
        # rtol 1e-12 over some hundred steps
        assert found == pytest.approx(door.angle(time) - door.start, rel=0, abs=1e-10)
    assert dataset.attrs["redundant_closure_rows"] == 5
    assert set(dataset.mobility.values) == {1}
    assert "condition" not in dataset  # no row is solved for
    assert dataset.reaction_redundant.values.tolist() == [1, 1]
    # both hinges together: the weight, and what bends the door's path
    force = dataset.joint_force.sum("joint").values
    known = door.mass * (dataset.acceleration.sel(body="door").values - [0.0, 0.0, -G])
    assert force == pytest.approx(known, rel=0, abs=1e-10 * door.mass * G)


def test_a_door_vibrates_with_the_frequency_of_a_small_pendulum() -> None:
    door, found = Door(), frequencies("checks/door")
    assert found.attrs["undetermined_reactions"] == "low, high"
    # a smooth closed form, differenced to 1e-9
    assert found.frequency.values == pytest.approx([door.pace / (2.0 * np.pi)], rel=1e-9)
    assert found.attrs["mobility"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "solver, error",
    [
        ({"integrator": "radau", "rtol": 1e-9}, 1e-7),
        ({"integrator": "generalized-alpha", "step": 1e-3}, 1e-4),
        ({"integrator": "dopri5", "rtol": 1e-10}, 1e-8),
        ({"integrator": "rk4", "step": 2e-3}, 1e-7),
        ({"integrator": "adams-bashforth-moulton", "step": 1e-3}, 1e-7),
    ],
    ids=lambda value: value["integrator"] if isinstance(value, dict) else "",
)
def test_every_method_swings_a_door_whose_closures_keep_no_row(solver: dict[str, object], error: float) -> None:
    """Errors: ten times what such steps leave on a pendulum."""
    door, overrides = Door(), tuple((f"solver.{key}", value) for key, value in solver.items())
    dataset = run("checks/door", overrides)
    found = dataset.joint_position.sel(coordinate="low").values
    assert found == pytest.approx(door.angle(dataset.time.values) - door.start, rel=0, abs=error)


def test_drives_of_a_tiny_loop_reach_their_pose_as_those_of_a_large_one() -> None:
    """They go in strides of an angle, not of metres: frequencies are as the root of one over the size."""
    made = UNITS["five-bar"](np.random.default_rng(8))
    found = []
    for size in (1.0, 1e-7):
        table = hung_up(made, np.random.default_rng(3), Setting(size))
        table["load"]["gravity"]["acceleration"] = [0.0, -G, 0.0]
        table["drive"] = {"crank": {"joint": "pin0", "law": {"type": "constant", "value": 0.0}}}
        held = analyses.frequencies(Scene.model_validate(table), {}, lambda fraction, text: None, None, {"crank": 0.2})
        found.append(held.frequency.values * np.sqrt(size))
    assert found[1] == pytest.approx(found[0], rel=1e-7)
