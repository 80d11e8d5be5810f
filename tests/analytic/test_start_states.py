"""Runs that begin by joint coordinate, by modes, at the equilibrium, or as their ideal twins: closed forms of each."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

from flexclear.dynamics.run.coordinates import joint_coordinates
from flexclear.dynamics.run.evaluation.observation import observe, rows_of
from flexclear.dynamics.starts import ideal, snapshot
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import edited, load_scene
from flexclear.scene.loose_joints import ClearanceRevolute
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, bundles
from tests.properties import mechanisms
from tests.properties.mechanisms import joint, rigid, scene, simulated
from tests.properties.test_assembly import loose
from tests.properties.test_dynamics_start import angles

G = 9.81
CHECKS = TREE / "scenes" / "checks"


def simulate(scene: Scene) -> xr.Dataset:
    return simulated(scene, bundles(scene))


# A four-bar, by the rate of a coordinate -----------------------------------------------------------------------------


@pytest.mark.parametrize("name, k", [("j0", 0), ("j3", 2)])
def test_the_rate_of_one_coordinate_sets_the_loop_in_motion(name: str, k: int) -> None:
    crank, rate = 0.9, 3.0
    step = 1e-4
    # of the closed form, by central differences; its error is some 1e-8
    fractions = (np.array(angles(crank + step)) - np.array(angles(crank - step))) / (2.0 * step)
    start = {"j0": {"position": crank}, "j3": {"near": 1.5}}
    start[name] = start[name] | {"velocity": f"{rate * fractions[k]} rad/s"}
    table = loose(crank, joint=start)
    del table["drive"]
    run = simulate(Scene.model_validate(table))
    found = run.angular_velocity.sel(body=["crank", "coupler", "rocker"]).values[0, :, 2]
    assert found == pytest.approx(rate * fractions, rel=1e-6)
    assert float(run.joint_position.sel(coordinate="j0")[0]) == pytest.approx(crank, abs=1e-10)
    assert "start_mended" not in run.attrs


def test_rates_of_coordinates_that_contradict_each_other_are_refused() -> None:
    table = loose(0.9, joint={"j0": {"position": 0.9, "velocity": 3.0}, "j3": {"near": 1.5, "velocity": 9.0}})
    del table["drive"]
    with pytest.raises(
        InputError, match=r"\[start.joint.j0.velocity\]: joints and drives do not allow the given velocities"
    ):
        simulate(Scene.model_validate(table))


# A cantilever, by its modes and at its equilibrium -------------------------------------------------------------------


@cache
def cantilever(**start: Any) -> xr.Dataset:
    """The clamped rod of scenes/checks for 2 ms; its weight only where it begins at the equilibrium."""
    weight = {} if "at" in start else {"load": {}}
    table = start if "at" in start else {"modal": {"rod": start}}
    return simulate(load_scene(CHECKS / "clamped_rod.toml", {**weight, "start": table, "time.end": "2 ms"}))


def first_frequencies() -> np.ndarray:
    """Of the rod's modes, clamped as they are made [rad/s]."""
    scene = load_scene(CHECKS / "clamped_rod.toml")
    return np.asarray(np.sqrt(np.diag(bundles(scene)["rod"]["modal_stiffness"].values)))


def test_a_cantilever_let_go_in_a_mode_is_the_cosine_of_its_frequency() -> None:
    size, omega = 1e-4, first_frequencies()
    run = cantilever(coordinate=(size,))
    q = run.modal_coordinate.values
    # rtol 1e-10; the other modes are touched by terms of second order alone, of the size of q over the rod's
    assert q[:, 0] == pytest.approx(size * np.cos(omega[0] * run.time.values), abs=1e-9 * size)
    assert np.abs(q[:, 1:]).max() < 1e-7 * size


def test_a_cantilever_struck_in_a_mode_is_the_sine_of_its_frequency() -> None:
    size, omega = 1e-4, first_frequencies()
    run = cantilever(velocity=(0.0, 0.0, size * omega[2]))
    assert run.modal_coordinate.values[:, 2] == pytest.approx(
        size * np.sin(omega[2] * run.time.values), abs=1e-7 * size
    )


def test_a_cantilever_that_begins_at_its_equilibrium_stays_there() -> None:
    run = cantilever(at="equilibrium")
    length, stiffness, line = 0.24, 7.17e10 * np.pi * 1e-8 / 4.0, 2740.0 * np.pi * 1e-4
    sag = line * G * length**4 / (8.0 * stiffness)
    tip = run.frame_position.sel(frame="rod.top", axis="z").values
    # the static shapes carry loads at the ends; of a uniform one they and ten vibrations leave 1e-5
    assert tip[0] == pytest.approx(-sag, rel=1e-4)
    assert np.abs(tip - tip[0]).max() < 1e-7 * sag  # forces are in balance to 1e-12 of the weight


# A pendulum of a beam, held at an angle ------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_beam_held_at_an_angle_sags_and_is_let_go_from_there() -> None:
    length, side, density, modulus = 0.3, 8e-3, 7870.0, 200e9
    line, stiffness, angle = density * side**2, modulus * side**4 / 12.0, 0.5
    table = {
        "title": "pendulum of a beam",
        "time": {"end": 1e-3},
        "output": {"interval": 5e-5},
        "load": {"weight": {"type": "gravity", "acceleration": [0.0, -G, 0.0]}},
        "body": {
            "ground": {"type": "ground", "frames": {"hook": {}}},
            "rod": {
                "type": "flexible",
                "mesh": str(TREE / "meshes" / "checks" / "crank_rod.toml"),
                "modes": {"reference": "craig-bampton", "count": 14, "interfaces": ["crank", "slider"]},
            },
        },
        "joint": {"pin": {"type": "revolute", "between": ["ground.hook", "rod.crank"]}},
        "start": {"at": "equilibrium", "joint": {"pin": {"position": angle}}},
    }
    run = simulate(Scene.model_validate(table))
    assert float(run.joint_position[0, 0]) == pytest.approx(angle, abs=1e-13)  # it is held there
    assert float(run.joint_velocity[0, 0]) == 0.0
    tip = run.frame_position.sel(frame="rod.slider").values[0]
    across = np.array([-np.sin(angle), np.cos(angle), 0.0])
    sag = line * G * np.cos(angle) * length**4 / (8.0 * stiffness)
    # modes beyond the fourteenth hold 1e-5 of it at most
    assert across @ tip == pytest.approx(-sag, rel=1e-4)
    # let go, it keeps its energy: the default tolerance is 1e-10
    assert np.abs(run.energy_error.values).max() < 1e-9 * line * length * G * length


def test_what_rounding_leaves_of_a_state_is_zero_in_the_scene_that_begins_there() -> None:
    """Scenes take no number below 1e-50: a modal rate of 5e-79 comes of rounding alone."""
    assert snapshot.round_for_scene(np.array([5e-79, -3e-60, 1e-20, -2.0])) == [0.0, 0.0, 1e-20, -2.0]


# On a stop, at rest ---------------------------------------------------------------------------------------------------


def lever(**stop: Any) -> xr.Dataset:
    """A lever of 3 kg whose weight at 0.5 m and whose spring press it on its stop, at its equilibrium."""
    turned = {"axes": {"z": [0, 1, 0], "x": [1, 0, 0]}}
    bodies = {
        "ground": {"type": "ground", "frames": {"O": turned}},
        "lever": rigid(3.0, [1e-2, 0.1, 0.1], {"O": turned}, com=[0.5, 0.0, 0.0]),
    }
    spring = {"type": "joint-spring", "joint": "O", "stiffness": 10.0, "rest": 0.5}
    end = {"joint": "O", "upper": 0.01, "normal": {"law": "hertz", "exponent": 1, "stiffness": 1e6}} | stop
    loads = {"g": {"type": "gravity", "acceleration": [0, 0, -G]}, "spring": spring}
    hinge = {"O": joint("revolute", "ground.O", "lever.O")}
    return mechanisms.simulate(scene(bodies, hinge, 0.01, load=loads, stop={"O": end}, start={"at": "equilibrium"}))


@pytest.mark.parametrize("stop", [{}, {"initial_approach_speed": 0}])
def test_a_lever_begins_at_rest_on_its_stop(stop: dict[str, Any]) -> None:
    run = lever(**stop)

    def torque(angle: float) -> float:
        return 3.0 * G * 0.5 * np.cos(angle) + 10.0 * (0.5 - angle)

    angle = brentq(lambda angle: 1e6 * (angle - 0.01) - torque(angle), 0.01, 0.02, xtol=1e-15)
    assert run.contact_normal_force.values[:, 0] == pytest.approx(torque(angle), rel=1e-8)
    weight = np.linalg.norm(run.joint_force.values[:, 0], axis=1)
    assert weight == pytest.approx(3.0 * G, rel=1e-8)
    assert np.abs(run.velocity.values).max() < 1e-9


def test_a_stop_takes_no_negative_speed_at_the_start() -> None:
    with pytest.raises(InputError, match="must be positive or 0, not -1"):
        lever(initial_approach_speed=-1.0)


def test_a_block_yanked_off_a_damped_end_loses_what_the_end_takes() -> None:
    """The end's law contains no mass. At rest it bears the weight; the force ends before the surfaces separate."""
    bodies = {"ground": {"type": "ground", "frames": {"O": {}}}, "block": rigid(1.0, 1e-3, {"O": {}})}
    pull = {"type": "step", "start": 0.01, "end": 0.0101, "change": 500.0}
    loads = {
        "g": {"type": "gravity", "acceleration": [0, 0, -G]},
        "pull": {"type": "joint-force", "joint": "rail", "force": pull},
    }
    end = {"joint": "rail", "lower": 0, "normal": {"law": "kelvin-voigt", "stiffness": 1e4, "damping": 300.0}}
    rail, begin = {"rail": joint("prismatic", "ground.O", "block.O")}, {"at": "equilibrium"}
    run = mechanisms.simulate(scene(bodies, rail, 0.1, 1e-10, load=loads, stop={"floor": end}, start=begin))
    force = run.contact_normal_force.values[:, 0]
    assert force[0] == pytest.approx(1.0 * G, rel=1e-9)
    assert float(run.contact_penetration[0, 0]) == pytest.approx(G / 1e4, rel=1e-9)
    assert force[-1] == 0.0
    assert np.isnan(float(run.contact_delivered_restitution[0]))
    gained = float(run.kinetic[-1] + run.potential[-1] - run.potential[0])
    assert np.abs(run.energy_error).max() < 1e-9 * gained


# Clearance as without ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_loose_pin_begins_at_rest_in_its_socket_as_the_ideal_joint_presses_it() -> None:
    """The bar lets go from the horizontal with the force of the ideal hinge, and goes on with it."""
    changes = {"time.end": "2 ms", "output.interval": "0.1 ms"}
    loose_one = simulate(load_scene(CHECKS / "clearance_pendulum.toml", {**changes, "start.at": "ideal"}))
    mass, along, across = 1.0, 0.3, 0.002
    about = 2e-2 + mass * (along**2 + across**2)  # [kg m^2] about the hinge, y of the bar
    alpha = mass * G * along / about
    force = mass * np.array([alpha * across, G - alpha * along])  # along the bar and upwards, on the bar
    first = loose_one.isel(time=0)
    # the offset of 0.1 mm moves the hinge, by 3e-4 of the arm
    assert float(first.contact_normal_force[0]) == pytest.approx(np.linalg.norm(force), rel=1e-2)
    offset = first.contact_offset.values[0]
    assert np.linalg.norm(offset) - 1e-4 == pytest.approx(float(first.contact_penetration[0]), rel=1e-6)
    forces = loose_one.contact_normal_force.values[:, 0]
    assert forces.max() < 1.2 * forces[0]  # nothing is hit
    assert forces.min() > 0.8 * forces[0]
    kinds = loose_one.event_kind.values.tolist()
    assert kinds[0] == "closing"  # which the start already has
    assert float(loose_one.event_approach_speed[0]) == 0.0
    assert {"opening", "closing"} & set(kinds[1:]) == set()


@pytest.mark.slow
def test_a_bar_on_a_loose_pin_that_begins_at_its_equilibrium_hangs_there() -> None:
    changes: dict[str, object] = {"time.end": "2 ms", "output.interval": "0.1 ms", "start.at": "equilibrium"}
    run = simulate(load_scene(CHECKS / "clearance_pendulum.toml", changes))
    assert run.contact_normal_force.values[:, 0] == pytest.approx(1.0 * G, rel=1e-6)
    assert np.abs(run.velocity.values).max() < 1e-8


def test_pins_are_pressed_into_their_places_without_bending_a_rod_or_being_held_back_by_a_stop() -> None:
    """The rod of the slider-crank begins as bent as without clearance; a compressed one would hit its pin at once.

    Pin and journal touch as deep as carries the force of the twin's joint. Of the two ways in which the twin can be
    assembled where only the drive says how its crank stands, one is taken, and both are reported.
    """
    template = TREE / "pipeline" / "flexclear" / "stages" / "templates" / "slider_crank" / "slider_crank.toml"
    stop = {"joint": "guide", "upper": "0.4 m", "normal": {"law": "flores", "restitution": 0.5, "stiffness": 1e8}}
    unplaced = {f"body.{name}.pose": None for name in ("crank", "rod", "slider")}
    law = {"type": "polynomial", "coefficients": ["20 deg", "100 rpm"]}
    requested = {**unplaced, "start": {"at": "ideal"}, "drive.motor.law": law, "stop": {"end": stop}}
    scene = edited(load_scene(template), requested)
    begun, choice = ideal.begin(scene, bundles(scene), lambda fraction, text: None)
    assert "assembled in 2 ways" in choice
    assert begun.start is not None
    engine, y = ideal._start_ideal(ideal.with_placing_joints(scene), bundles(scene), lambda fraction, text: None)
    loaded = ideal._deform_statically(engine, y)
    # pressing bends the rod by rounding of its length
    assert begun.start.modal["rod"].coordinate == pytest.approx(loaded[ideal._modes(engine)], abs=1e-12)
    crank, rod = (begun.body[name].pose for name in ("crank", "rod"))
    assert crank is not None
    assert rod is not None
    joint = begun.joint["pin"]
    assert isinstance(joint, ClearanceRevolute)
    pin = np.array(crank.position) + 0.05 * np.array([np.cos(np.radians(20.0)), np.sin(np.radians(20.0)), 0.0])
    apart = np.linalg.norm(pin - rod.position)
    assert joint.clearance < apart < 1.01 * joint.clearance
    assert joint.initial_approach_speed == 0.0


def test_flexible_bodies_begin_an_ideal_start_as_its_loads_hold_them() -> None:
    """Their modes do not accelerate then, so that no first peak of a force is that of springing into their shape."""
    template = TREE / "pipeline" / "flexclear" / "stages" / "templates" / "slider_crank" / "slider_crank.toml"
    scene = edited(load_scene(template), {"start": {"at": "ideal"}})
    engine, y = ideal._start_ideal(ideal.with_placing_joints(scene), bundles(scene), lambda fraction, text: None)
    speeds = ideal._modal_speeds(engine)
    straight = ideal._accelerations(engine, y, speeds)
    loaded = ideal._deform_statically(engine, y)
    assert np.abs(loaded[ideal._modes(engine)]).max() > 0.0
    # differences over 1e-7 of the size are good to 1e-9 of the stiffness; loops keep what they hold
    assert np.abs(ideal._accelerations(engine, loaded, speeds)).max() < 1e-6 * np.abs(straight).max()


def test_pressing_pins_into_their_places_leaves_exact_joint_positions_as_they_are() -> None:
    """The crank of a four-bar is given an angle and a rate; the pin between coupler and rocker is loose by 0.2 mm.

    Without this the nearest pressed state turns the crank, too: by 4e-4 rad.
    """
    joints = {"A": {"position": "30 deg", "velocity": "2 rad/s"}, "D": {"near": "80 deg"}}
    posed = {f"body.{name}.pose": None for name in ("crank", "coupler", "rocker")}
    scene = load_scene(CHECKS / "clearance_four_bar.toml", {**posed, "start": {"at": "ideal", "joint": joints}})
    begun, _ = ideal.begin(scene, bundles(scene), lambda fraction, text: None)
    crank = begun.body["crank"]
    assert crank.pose is not None
    x, y, _ = quaternion_to_matrix(crank.pose.as_quaternion())[:, 0]
    assert np.arctan2(y, x) == pytest.approx(np.radians(30.0), rel=0, abs=1e-12)  # rounding
    assert crank.angular_velocity == pytest.approx([0.0, 0.0, 2.0], rel=0, abs=1e-12)
    assert begun.drive == {}
    # with the rocker given as well, the coupler alone cannot bring its pin to the wall
    engine, y = ideal._start_ideal(ideal.with_placing_joints(scene), bundles(scene), lambda fraction, text: None)
    rocker = joint_coordinates(engine.model, observe(engine, rows_of(engine, y[None], engine.start)))["D"][0][0]
    both = edited(scene, {"start.joint.D": {"position": f"{rocker} rad"}})
    begun, choice = ideal.begin(both, bundles(both), lambda fraction, text: None)
    assert choice == "the pins are not pressed into their sockets without moving given joint positions"


def test_pins_that_share_a_force_in_an_unknown_way_begin_in_the_middle() -> None:
    """Of two ideal hinges on one axis, the first one carries the door, the second nothing: no pose presses both."""
    scene = load_scene(TREE / "tests" / "reference" / "tried" / "door_on_loose_pins.toml", {"start": {"at": "ideal"}})
    begun, choice = ideal.begin(scene, {}, lambda fraction, text: None)
    door = begun.body["door"]
    assert door.pose is not None
    assert door.pose.position == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)
    assert "rigid bodies leave open how they share their force" in choice


def test_a_start_as_without_clearance_leaves_a_ball_on_a_plane_where_it_is() -> None:
    """No ideal joint has its place, so the poses are those of the scene."""
    scene = load_scene(CHECKS / "ball_on_plane.toml", {"start.at": "ideal"})
    begun, _ = ideal.begin(scene, {}, lambda fraction, text: None)
    assert begun.joint == scene.joint
    for name, body in scene.rigid().items():
        # through a quaternion and back: rounding
        assert begun.body[name].pose.position == pytest.approx(body.pose.position, abs=1e-12)
