"""What must not depend on where a mechanism stands, what its parts are called, in which order, which way round and in
which units it is written."""

import json
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.numerics.rotations import (
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from flexclear.scene.fields import Pose
from flexclear.scene.load import load_scene
from tests.analytic.mechanism_runs import TREE, impacts
from tests.properties.mechanisms import Table, simulate

IDEAL, CSJ, BOUNCE = "sps4/ideal", "sps4/variants/first_csj", "checks/bounce"
#: two loops that pass four singular poses, and a top that nutates
LOOPS, TOP = "checks/four_bars_2", "checks/heavy_top"
#: about no axis of the scene, and far from where it stands
TURN, SHIFT = rotation_vector_to_matrix(np.array([0.7, -1.9, 0.4])), np.array([3.0, -2.0, 5.0])


def table_of(name: str, **overrides: object) -> Table:
    """A scene as a table of numbers, every default written out."""
    return load_scene(TREE / "scenes" / f"{name}.toml", overrides).model_dump(exclude_none=True)


# Turning and shifting -----------------------------------------------------------------------------------------------


def moved(table: Table, R: np.ndarray, shift: np.ndarray) -> Table:
    """The same scene, all of it turned by R about the origin and then shifted."""
    result = dict(table)
    result["body"] = {n: _moved_body(b, R, shift) for n, b in table["body"].items()}
    result["load"] = {n: {**g, "acceleration": tuple(R @ g["acceleration"])} for n, g in table.get("load", {}).items()}
    return result


def _moved_body(body: Table, R: np.ndarray, shift: np.ndarray) -> Table:
    result = dict(body)
    if body["type"] == "ground":
        result["frames"] = {n: _moved_pose(p, R, shift) for n, p in body["frames"].items()}
    if "pose" in body:
        result["pose"] = _moved_pose(body["pose"], R, shift)
    for name in ("velocity", "angular_velocity"):
        if name in body:
            result[name] = tuple(R @ body[name])
    return result


def _moved_pose(pose: Table, R: np.ndarray, shift: np.ndarray) -> Table:
    here = Pose.model_validate(pose)
    turned = matrix_to_quaternion(R @ quaternion_to_matrix(here.as_quaternion()))
    return {"position": tuple(R @ np.array(here.position) + shift), "quaternion": tuple(turned)}


def largest(difference: xr.DataArray | np.ndarray) -> float:
    return float(np.abs(np.asarray(difference)).max())


def settings(name: str) -> dict[str, object]:
    """To the end of its run at a tight tolerance; loops of whose poses some are singular have fifty outputs."""
    end = RUNS[name][0]
    interval = {"output.interval": float(end.split()[0]) / 50.0} if name in (LOOPS, TOP) else {}
    return {"time.end": end, "solver": {"rtol": 1e-12}, **interval}


@cache
def original(name: str) -> tuple[Table, xr.Dataset]:
    table = table_of(name, **settings(name))
    return table, simulate(table)


@cache
def elsewhere(name: str) -> xr.Dataset:
    return simulate(moved(original(name)[0], TURN, SHIFT))


def here_and_there(name: str) -> tuple[xr.Dataset, xr.Dataset]:
    return comparable(original(name)[1]), comparable(elsewhere(name))


def comparable(run: xr.Dataset) -> xr.Dataset:
    """The rows at regular outputs and where contacts begin or end.

    Within contacts rows stand where a force or a depth is largest, whose time follows from its value, which is flat
    there, to the root of its error only. Steps over singular poses are recorded too, and end a little elsewhere.
    """
    interval = json.loads(run.attrs["parameters"])["output"]["interval"]
    steps = run.time.values / interval
    chosen = np.abs(steps - np.round(steps)) < 1e-9 * np.maximum(steps, 1.0)
    if "event_time" in run:
        located = run.event_time.values[run.event_kind.isin(["opening", "closing"]).values]
        chosen |= np.isin(run.time.values, located)
    return run.isel(time=np.flatnonzero(chosen))


#: scene -> its end; share of the largest value by which turned vectors may differ, and positions. An ideal motion is
#: what the drives prescribe, to projection (1e-13 m). With contacts the steps differ a little, as the largest component
#: of a vector depends on the axes: errors of rtol 1e-12 grow some ten times, and a contact of 1e-4 s that comes
#: 1e-11 s earlier differs by 1e-7 of its force
RUNS = {IDEAL: ("0.18 s", 1e-9, 1e-9), CSJ: ("0.06 s", 1e-7, 1e-9), BOUNCE: ("0.99 s", 1e-7, 1e-9)}
#: loops step alike but for rounding
RUNS |= {LOOPS: ("3.5 s", 1e-9, 1e-9), TOP: ("0.3 s", 1e-9, 1e-9)}
every_run = pytest.mark.parametrize("name", RUNS)


@every_run
def test_a_scene_turned_and_shifted_moves_just_as_it_did(name: str) -> None:
    _, fraction, near = RUNS[name]
    here, there = here_and_there(name)
    assert len(here.time) == len(there.time)
    size = largest(here.position - here.position.isel(time=0))
    assert largest(there.position.values - (here.position.values @ TURN.T + SHIFT)) <= near * size
    # of loops with redundant rows reactions are not unique
    forces = [] if name == LOOPS else ["joint_force"]
    for field in ("velocity", "angular_velocity", "acceleration", *forces):
        known = here[field].values @ TURN.T
        assert largest(there[field].values - known) <= fraction * max(largest(known), 1e-3), field
    turned = TURN @ quaternion_to_matrix(here["quaternion"].values)
    assert largest(quaternion_to_matrix(there["quaternion"].values) - turned) <= near
    # rounding decides on some steps next to singular poses; error groups that depend on the axes would change many
    assert there.attrs["evaluations"] == pytest.approx(here.attrs["evaluations"], rel=0.1)


@pytest.mark.parametrize("name", [CSJ, BOUNCE])
def test_its_impacts_stay_the_same(name: str) -> None:
    here, there = map(impacts, here_and_there(name))
    assert len(here["start"]) >= 3
    for field in ("start", "approach"):
        assert there[field] == pytest.approx(here[field], rel=RUNS[name][2]), field
    # the peak is read from samples of the dense output by a parabola
    assert there["peak_force"] == pytest.approx(here["peak_force"], rel=1e-3)


@every_run
def test_energies_do_not_depend_on_the_axes(name: str) -> None:
    here, there = here_and_there(name)
    fraction = RUNS[name][1]
    size = largest(here.kinetic)
    for field in ("kinetic", "elastic", "dissipated", "drive_work"):
        assert largest(here[field].values - there[field].values) <= fraction * size, field


# Order and direction ------------------------------------------------------------------------------------------------


def reordered(table: Table) -> Table:
    """Bodies, joints and drives in the opposite order."""
    return {**table, **{f: dict(reversed(table[f].items())) for f in ("body", "joint", "drive")}}


def reversed_joints(table: Table) -> Table:
    """Every ideal joint from its second frame to its first; a driven one then moves the other way."""
    joints = {}
    for name, joint in table["joint"].items():
        clearance = joint["type"] == "clearance-spherical"
        joints[name] = joint if clearance else {**joint, "between": joint["between"][::-1]}
    drives = {n: {**d, "law": _negative(d["law"])} for n, d in table["drive"].items()}
    return {**table, "joint": joints, "drive": drives}


def _negative(law: Table) -> Table:
    if law["type"] == "constant":
        return {**law, "value": _opposite(law["value"])}
    return {**law, "change": tuple(_opposite(h) for h in law["change"])}


def _opposite(value: float | str) -> float | str:
    """Of a number, or of text with a unit."""
    if not isinstance(value, str):
        return -value
    return value[1:] if value.startswith("-") else f"-{value}"


def assert_same_motion(name: str, found: xr.Dataset) -> None:
    known, found = comparable(original(name)[1]), comparable(found)
    assert len(found.time) == len(known.time)
    found = found.sel(body=known.body.values)
    for field in ("position", "velocity", "angular_velocity", "acceleration"):
        assert largest(found[field].values - known[field].values) <= RUNS[name][1] * largest(known[field]), field


@pytest.mark.parametrize("name", [IDEAL, CSJ])
@pytest.mark.parametrize("rewrite", [reordered, reversed_joints], ids=lambda f: f.__name__)
def test_the_motion_does_not_depend_on_how_the_mechanism_is_written(name: str, rewrite: Any) -> None:
    """Other trees, other coordinates, other error groups, one motion."""
    assert_same_motion(name, simulate(rewrite(original(name)[0])))


@pytest.mark.parametrize("name", [LOOPS, TOP])
def test_the_motion_does_not_depend_on_what_parts_are_called(name: str) -> None:
    """Other names in another order: another tree, other closures, other rows selected."""
    table = original(name)[0]
    bodies = {b: f"part{k}" for k, b in enumerate(sorted(table["body"], reverse=True))}
    joints = {}
    for k, old in enumerate(sorted(table["joint"], reverse=True)):
        frames = [frame.partition(".") for frame in table["joint"][old]["between"]]
        joints[f"pair{k}"] = table["joint"][old] | {"between": tuple(f"{bodies[b]}.{rest}" for b, _, rest in frames)}
    renamed = {new: table["body"][old] for old, new in bodies.items()}
    found = simulate({**table, "body": renamed, "joint": joints})
    called = {new: old for old, new in bodies.items()}
    assert_same_motion(name, found.assign_coords(body=[called[b] for b in found.body.values]))


def test_the_motion_does_not_depend_on_units(tmp_path: Path) -> None:
    """Lengths in mm, masses in g, angular velocities in deg/s, as the scene file may say them."""
    with (TREE / "scenes" / f"{LOOPS}.toml").open("rb") as file:
        scene = _in_other_units(tomllib.load(file))
    other = load_scene(_written(scene, tmp_path), settings(LOOPS))
    assert_same_motion(LOOPS, simulate(other.model_dump(exclude_none=True)))


def _in_other_units(scene: Table) -> Table:
    for body in scene["body"].values():
        for pose in [body.get("pose", {}), *body.get("frames", {}).values()]:
            if "position" in pose:
                pose["position"] = _as(pose["position"], 1e3, "mm")
        for key, factor, unit in (("com", 1e3, "mm"), ("velocity", 1e3, "mm/s")):
            if key in body:
                body[key] = _as(body[key], factor, unit)
        if "angular_velocity" in body:
            body["angular_velocity"] = _as(body["angular_velocity"], 180.0 / np.pi, "deg/s")
        if "mass" in body:
            body["mass"], body["inertia"] = f"{1e3 * body['mass']!r} g", _as(body["inertia"], 1e6, "kg mm^2")
    scene["load"]["gravity"]["acceleration"] = _as(scene["load"]["gravity"]["acceleration"], 1e3, "mm/s^2")
    return scene


def _as(values: list[float], factor: float, unit: str) -> list[str]:
    return [f"{factor * v!r} {unit}" for v in values]


def _written(scene: Table, folder: Path) -> Path:
    file = folder / "scene.toml"
    file.write_text("\n".join(f"{key} = {_toml(value)}" for key, value in scene.items()))
    return file


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return repr(value) if not isinstance(value, str) else f'"{value}"'


@pytest.mark.parametrize("rewrite", [reordered, reversed_joints], ids=lambda f: f.__name__)
def test_reactions_do_not_depend_on_how_the_mechanism_is_written(rewrite: Any) -> None:
    table, known = original(IDEAL)
    found = simulate(rewrite(table)).sel(joint=known.joint.values)
    sign = -1.0 if rewrite is reversed_joints else 1.0
    # spherical joints: whichever frame comes first, the force passes through one point
    names = [n for n, j in table["joint"].items() if j["type"] == "spherical"]
    for field, which in (("joint_force", {"joint": names}), ("drive_force", {"drive": known.drive.values})):
        a, b = (run[field].sel(which).values for run in (found, known))
        assert largest(sign * a - b) <= 1e-8 * largest(b)


# Conservation -------------------------------------------------------------------------------------------------------


def momenta(dataset: xr.Dataset, table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s] of all rigid bodies, shape (time, 3)."""
    linear, angular = np.zeros(3), np.zeros(3)
    for name, body in table["body"].items():
        if body["type"] == "rigid":
            part = dataset.sel(body=name)
            R = quaternion_to_matrix(part["quaternion"].values)
            spin = np.einsum("tij,jk,tlk,tl->ti", R, np.array(body["inertia"]), R, part.angular_velocity.values)
            p = body["mass"] * part.velocity.values
            linear, angular = linear + p, angular + spin + np.cross(part.position.values, p)
    return linear, angular


def test_a_free_body_keeps_its_momenta() -> None:
    table = table_of("checks/free_body", load={}, solver={"rtol": 1e-13})
    linear, angular = momenta(simulate(table), table)
    # no force: nothing but rounding acts on the velocity
    assert largest(linear - linear[0]) <= 1e-12 * largest(linear[0])
    # errors of rtol 1e-13 in some hundred steps, which its unstable spin multiplies
    assert largest(angular - angular[0]) <= 1e-10


def two_free_bodies() -> Table:
    """A ball in a socket that flies freely and spins; both centres of mass lie off the joint."""
    table = table_of(BOUNCE)
    table["load"], table["time"], table["output"] = {}, {"end": 2.0}, {"interval": 1e-2}
    inertia = ((0.03, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.04))
    table["body"] = {
        "shell": {
            "type": "rigid", "mass": 3.0, "inertia": inertia, "com": (0.02, 0.0, -0.01), "pose": {},
            "velocity": (0.3, 0.1, 0.0), "angular_velocity": (1.0, -2.0, 0.5), "frames": {"socket": {}},
        },
        "ball": {**table["body"]["ball"], "com": (0.0, 0.01, 0.0), "velocity": (-0.9, 0.2, 0.5)},
    }  # fmt: skip
    table["joint"]["contact"]["between"] = ("shell.socket", "ball.centre")
    return table


def test_two_bodies_that_collide_keep_their_momenta_together() -> None:
    """Both forces of a contact act at one point, so that their moments cancel too."""
    table = two_free_bodies()
    dataset = simulate(table)
    assert len(impacts(dataset)["start"]) >= 3
    linear, angular = momenta(dataset, table)
    speed = largest(dataset.velocity.values)
    # rtol 1e-10 over some hundred steps
    assert largest(linear - linear[0]) <= 1e-8 * 3.0 * speed
    assert largest(angular - angular[0]) <= 1e-8 * largest(angular)


def test_a_free_chain_keeps_its_momenta() -> None:
    """Three bodies joined in a closed loop fly freely and tumble: nothing acts from outside."""
    loop = _flying_loop()
    linear, angular = momenta(simulate(loop), loop)
    assert largest(linear - linear[0]) <= 1e-10 * largest(linear[0])
    assert largest(angular - angular[0]) <= 1e-10 * largest(angular[0])


def _flying_loop() -> Table:
    """Four rods around a square, joined by hinges at its corners, pushed and spun."""
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
    bodies: Table = {}
    for k, (x, y, z) in enumerate(corners):
        following = corners[(k + 1) % 4]
        along = [b - a for a, b in zip((x, y, z), following, strict=True)]
        bodies[f"rod{k}"] = {
            "type": "rigid", "mass": 1.0 + 0.2 * k, "com": [0.5 * a for a in along],
            "inertia": [[0.05, 0.0, 0.0], [0.0, 0.06, 0.0], [0.0, 0.0, 0.08]], "pose": {"position": [x, y, z]},
            "frames": {"near": {}, "far": {"position": along}},
        }  # fmt: skip
    spin, push = np.array([0.8, -1.1, 2.0]), np.array([0.3, 0.2, -0.1])
    for body in bodies.values():
        centre = np.array(body["pose"]["position"]) + np.array(body["com"])
        body["velocity"], body["angular_velocity"] = list(push + np.cross(spin, centre)), list(spin)
    joints = {f"hinge{k}": {"type": "revolute", "between": [f"rod{k}.far", f"rod{(k + 1) % 4}.near"]} for k in range(4)}
    return {
        "title": "flying loop", "body": bodies, "joint": joints, "time": {"end": 1.0}, "output": {"interval": 0.05},
        "solver": {"rtol": 1e-13},
    }  # fmt: skip
