"""Frames on given paths: they go there, and the reported forces are those that it takes."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.dynamics.model.laws import drive_laws
from flexclear.dynamics.model.mechanism import build
from flexclear.dynamics.run.inverse import hermite
from flexclear.numerics.rotations import quaternion_to_matrix, rotation_vector_to_matrix
from flexclear.scene.load import load_scene
from flexclear.scene.schema import Scene
from flexclear.system.errors import InputError
from tests.analytic.mechanism_runs import TREE, run
from tests.properties.mechanisms import GRAVITY, body, frame, ground, joint, scene, simulate


def wave(amplitude: float, hertz: float, offset: float = 0.0) -> dict[str, Any]:
    return {"type": "harmonic", "amplitude": [amplitude], "frequency": [f"{hertz} Hz"], "offset": offset}


PLACE = {"x": wave(0.2, 1.0), "y": wave(0.1, 2.0, 0.3), "z": wave(-0.15, 1.5)}
ANGLES = {"x": wave(0.8, 1.0, 0.1), "y": wave(0.6, 0.7), "z": wave(-1.2, 1.3)}
TIP = frame((0.1, -0.05, 0.2), (0.4, 0.1, -0.3))


def flying(**path: Any) -> dict[str, Any]:
    bodies = {"base": ground(O=(0.0, 0.0, 0.0)), "b": body((0.0, 0.0, 0.0), mass=2.0, frames={"tip": TIP})}
    drive = {"path": {"frame": "b.tip", **path}}
    return scene(bodies, {}, end=0.5, drive=drive, load=GRAVITY, output={"interval": 0.01})


def laws(table: dict[str, Any], time: np.ndarray, order: int = 0) -> np.ndarray:
    """Derivatives of all prescribed components over time, shape (time, components)."""
    made = drive_laws(Scene.model_validate(table), {})
    return np.array([[law.value(float(t), order) for law in made] for t in time])


def cardan(a: Any) -> np.ndarray:
    parts = [rotation_vector_to_matrix(angle * axis) for angle, axis in zip(a, np.eye(3), strict=True)]
    return parts[0] @ parts[1] @ parts[2]


@pytest.mark.slow
@pytest.mark.parametrize("angles", ["cardan", "rotation-vector"])
def test_a_frame_follows_its_path_and_the_forces_are_newtons_and_eulers(angles: str) -> None:
    table = flying(position=PLACE, rotation=ANGLES, angles=angles)
    dataset = simulate(table)
    time = dataset.time.values
    prescribed, rates = laws(table, time), laws(table, time, 1)
    assert dataset.frame_position.sel(frame="b.tip").values == pytest.approx(prescribed[:, :3], abs=1e-13)
    turn = cardan if angles == "cardan" else rotation_vector_to_matrix
    own = rotation_vector_to_matrix(np.array(TIP["rotation_vector"]))
    R = quaternion_to_matrix(dataset["quaternion"].sel(body="b").values) @ own
    assert pytest.approx(np.array([turn(a) for a in prescribed[:, 3:]]), abs=1e-12) == R
    motion = dataset.sel(body="b")
    force = 2.0 * (motion.acceleration.values - [0.0, 0.0, -9.81])
    assert dataset.drive_force.values[:, :3] == pytest.approx(force, abs=1e-11)
    # power of all six = power that the body takes up, by Newton and Euler in the world
    world = R @ own.T @ np.diag([0.024, 0.04, 0.03]) @ own @ np.swapaxes(R, 1, 2)
    omega, alpha = motion.angular_velocity.values, motion.angular_acceleration.values
    spin = np.einsum("tij,tj->ti", world, omega)
    moment = np.einsum("tij,tj->ti", world, alpha) + np.cross(omega, spin)
    known = np.sum(force * motion.velocity.values, axis=1) + np.sum(moment * omega, axis=1)
    assert np.sum(dataset.drive_force.values * rates, axis=1) == pytest.approx(known, abs=1e-10)
    assert np.abs(dataset.energy_error.values).max() < 1e-9


@pytest.mark.slow
def test_components_without_a_law_stay_free() -> None:
    """Guided along x and about z only, the body falls, and y is free of force."""
    dataset = simulate(flying(position={"x": PLACE["x"]}, rotation={"z": ANGLES["z"]}))
    assert list(dataset.drive.values) == ["path.position.x", "path.rotation.z"]
    acceleration = dataset.acceleration.sel(body="b").values
    assert acceleration[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert acceleration[:, 2] == pytest.approx(-9.81, abs=1e-9)
    assert 2.0 * acceleration[:, 0] == pytest.approx(dataset.drive_force.values[:, 0], abs=1e-9)
    assert np.abs(dataset.energy_error.values).max() < 1e-8


# Inverse dynamics ---------------------------------------------------------------------------------------------------

IDEAL = "sps4/ideal"
HALF = (("time.end", 0.09),)  # to the jump of the drives' jerk: one smooth spline per component


def guided(known: xr.Dataset, actuators: tuple[str, ...], components: str = "zxyz") -> dict[str, Any]:
    """The ideal mechanism with its platform on the path that `known` took, and undriven legs."""
    R = quaternion_to_matrix(known["quaternion"].sel(body="platform").values)
    height = known.frame_position.sel(frame="platform.C").values[:, 2]
    angles = np.arctan2(-R[:, 1, 2], R[:, 2, 2]), np.arcsin(R[:, 0, 2]), np.arctan2(-R[:, 0, 1], R[:, 0, 0])
    splines = [
        {"type": "spline", "degree": 5, "time": list(known.time.values), "value": list(x)} for x in (height, *angles)
    ]
    table = load_scene(TREE / "scenes" / f"{IDEAL}.toml", dict(HALF)).model_dump(exclude_none=True)
    path: dict[str, Any] = {"frame": "platform.C", "actuators": actuators, "position": {"z": splines[0]}}
    if components == "zxyz":
        path["rotation"] = dict(zip("xyz", splines[1:], strict=True))
    table["drive"] = {"path": path}
    return table


@pytest.mark.slow
def test_the_legs_forces_of_a_prescribed_platform_are_those_that_moved_it() -> None:
    """Forwards the legs are driven and the platform follows; backwards its path is given and their forces asked."""
    known = run(IDEAL, HALF)
    legs = ("P1", "P2", "P3", "P4")
    found = simulate(guided(known, legs))
    assert list(found.drive.values) == list(legs)
    forces = known.drive_force.sel(drive=list(legs)).values
    assert len(found.time) == len(known.time)
    # splines through recorded angles: rounding 1e-15 rad / (1e-4 s)^2 gives 1e-7 of 44 rad/s^2
    assert found.drive_force.values == pytest.approx(forces, abs=1e-6 * np.abs(forces).max())
    for name in ("joint_force", "position"):
        assert found[name].values == pytest.approx(known[name].values, abs=1e-6 * np.abs(known[name]).values.max())
    assert found.attrs["parameters"].count("actuators") == 1


@pytest.mark.slow
def test_legs_take_the_platform_where_a_scene_wants_it() -> None:
    dataset = run("sps4/variants/guided", (("time.end", 0.09),))
    last = dataset.isel(time=-1)
    height = last.frame_position.sel(frame="platform.C").values
    # the loops of the second run are closed to 1e-13 m
    assert height == pytest.approx([0.0, 0.0, 0.36], abs=1e-12)
    R = quaternion_to_matrix(last["quaternion"].sel(body="platform").values)
    assert pytest.approx(cardan(np.radians([5.0, -8.0, 0.0])), abs=1e-11) == R
    # from rest, without gravity and losses, all work of the legs is kinetic energy
    assert dataset.drive_work.values == pytest.approx(dataset.kinetic.values, abs=1e-9 * float(dataset.kinetic.max()))


@pytest.mark.slow
@pytest.mark.parametrize(
    "actuators, problem",
    [
        (("P1", "P2", "P3"), "cannot produce"),
        (("P1", "P2", "P3", "P4", "Z"), "not unique"),
        (("P1", "P2", "P3", "A1"), "no single coordinate"),
        (("P1", "P2", "P3", "P9"), "no joint 'P9'"),
    ],
)
def test_actuators_that_cannot_or_are_too_many_are_refused(actuators: tuple[str, ...], problem: str) -> None:
    with pytest.raises(InputError, match=problem) as error:
        simulate(guided(run(IDEAL, HALF), actuators))
    assert "[drive.path.actuators" in str(error.value)


def table_of_two_rails(allocation: str) -> dict[str, Any]:
    """A slide with a crank: a block on a rail, a crank on a hinge, a rod (universal, spherical) between them."""
    bodies = {
        "base": {
            "type": "ground",
            "frames": {"rail": frame((0.0, 0.0, 0.0), (0.0, 1.2, 0.3)), "pin": frame((0.3, 0.4, 0.0))},
        },
        "block": body(
            (0.0, 0.0, 0.0),
            frames={"rail": frame((0.0, 0.0, 0.0), (0.0, 1.2, 0.3)), "eye": frame((0.0, 0.1, 0.0))},
        ),
        "crank": body((0.3, 0.4, 0.0), frames={"pin": frame((0.0, 0.0, 0.0)), "end": frame((0.1, 0.05, 0.1))}),
        "rod": body((0.0, 0.1, 0.0), frames={"eye": frame((0.0, 0.0, 0.0)), "end": frame((0.4, 0.35, 0.1))}),
    }
    joints = {
        "rail": joint("prismatic", "base.rail", "block.rail"),
        "pin": joint("revolute", "base.pin", "crank.pin"),
        "eye": joint("universal", "block.eye", "rod.eye"),
        "end": joint("spherical", "rod.end", "crank.end"),
    }
    path = {
        "frame": "block.eye",
        "position": {"x": {"type": "polynomial", "coefficients": [0.0, 0.0, 0.05]}},
        "actuators": ["pin", "rail"],
        "allocation": allocation,
    }
    return scene(bodies, joints, end=0.2, drive={"path": path}, load=GRAVITY)


@pytest.mark.slow
def test_actuators_beyond_the_freedoms_share_by_least_norm_when_asked_to() -> None:
    with pytest.raises(InputError, match="least-norm"):
        simulate(table_of_two_rails("unique"))
    shared = simulate(table_of_two_rails("least-norm"))
    alone = table_of_two_rails("unique")
    alone["drive"]["path"]["actuators"] = ["rail"]
    known = simulate(alone)
    assert set(shared.drive.values) == {"pin", "rail"}
    forces = {name: shared.drive_force.sel(drive=name).values for name in ("rail", "pin")}
    rates = {name: known.joint_velocity.sel(coordinate=name).values[1:] for name in ("rail", "pin")}
    ratio = rates["pin"] / rates["rail"]
    # one freedom: the rail's force alone is made up by rail + ratio * pin, least where pin = ratio * rail
    alone_force = known.drive_force.sel(drive="rail").values[1:]
    assert forces["rail"][1:] + ratio * forces["pin"][1:] == pytest.approx(alone_force, rel=1e-8)
    assert forces["pin"][1:] == pytest.approx(ratio * forces["rail"][1:], rel=1e-8)
    assert shared.position.values == pytest.approx(known.position.values, abs=1e-10)
    # the joints carry something else, and the energy is accounted for
    change = np.abs(shared.joint_force.sel(joint="end") - known.joint_force.sel(joint="end"))
    assert float(change.max()) > 0.1
    exchanged = float(np.abs(shared.drive_work).max() + np.abs(shared.load_work).max())
    # quintics and straight lines between outputs of 10 ms: the same in both, so that only rounding is left
    assert float(np.abs(shared.energy_error).max()) < 1e-8 * exchanged


@pytest.mark.parametrize("angles", ["cardan", "rotation-vector"])
def test_a_body_on_a_path_needs_no_pose(angles: str) -> None:
    """It starts where the laws put its frame; what it carries hangs on it, and components without a law are zero."""
    table = flying(position=PLACE, rotation=ANGLES, angles=angles)
    del table["body"]["b"]["pose"]
    own = rotation_vector_to_matrix(np.array(TIP["rotation_vector"]))
    for path in (table["drive"]["path"], {"frame": "b.tip", "position": {"y": 2.0}, "rotation": {"z": 0.5}}):
        table["drive"]["path"] = path
        made = build(Scene.model_validate(table), {})
        there = made.links[-1].start.of(made.links[-1].placements["b"])
        turn = cardan if angles == "cardan" else rotation_vector_to_matrix
        start = laws(table, np.zeros(1))[0]
        origin, turned = (start[:3], turn(start[3:])) if len(start) == 6 else ([0.0, 2.0, 0.0], cardan([0.0, 0.0, 0.5]))
        assert pytest.approx(turned @ own.T, abs=1e-14) == there.R
        assert made.origin + there.p == pytest.approx(origin - turned @ own.T @ TIP["position"], abs=1e-14)


def test_a_path_and_a_joint_drive_do_not_fight_unnoticed() -> None:
    """The same freedom prescribed twice, by a path and by a drive, closes a loop of driven joints."""
    table = scene(
        {"base": ground(O=(0.0, 0.0, 0.0)), "b": body((0.0, 0.0, 0.0), frames={"O": frame((0.0, 0.0, 0.0))})},
        {"slide": joint("prismatic", "base.O", "b.O")},
        drive={
            "slide": {"joint": "slide", "law": wave(0.1, 1.0)},
            "path": {"frame": "b.O", "position": {"z": wave(0.1, 1.0)}},
        },
    )
    with pytest.raises(InputError, match="closes a loop"):
        simulate(table)


def test_recorded_motions_are_continued_by_the_quintics_through_their_rows() -> None:
    """A polynomial of degree five is its own interpolation, rates and second rates included."""
    known, rows = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.7, -1.5, 0.4]), np.array([0.2, 0.5, 1.3])
    series = np.array([known.deriv(order)(rows) if order else known(rows) for order in range(3)])
    found = hermite(rows, series, series)
    for t in (0.2, 0.3, 0.49, 0.5, 0.9, 1.3):
        values = [found.value(t, order) for order in range(3)]
        assert values == pytest.approx([known.deriv(k)(t) if k else known(t) for k in range(3)], rel=1e-11)  # rounding
