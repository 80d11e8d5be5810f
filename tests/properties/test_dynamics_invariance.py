"""What must not depend on where a mechanism stands, in which order it is written, or which way round."""

import json
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

from flexclear.pipeline.core.numerics.rotations import (
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from flexclear.pipeline.core.scene.fields import Pose
from flexclear.pipeline.core.scene.load import load_scene
from tests.analytic.mechanism_runs import TREE, impacts
from tests.properties.mechanisms import Table, simulate

IDEAL, CSJ, BOUNCE = "sps4/ideal", "sps4/variants/first_csj", "checks/bounce"
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


@cache
def here_and_there(name: str, end: str) -> tuple[xr.Dataset, xr.Dataset]:
    table = table_of(name, **{"time.end": end, "solver": {"rtol": 1e-12}})
    return comparable(simulate(table)), comparable(simulate(moved(table, TURN, SHIFT)))


def comparable(run: xr.Dataset) -> xr.Dataset:
    """The rows at regular outputs and where contacts begin or end.

    Within contacts rows stand where a force or a depth is largest, whose time follows from its value, which is flat
    there, to the root of its error only.
    """
    if "event_time" not in run:
        return run
    interval = json.loads(run.attrs["parameters"])["output"]["interval"]
    steps = run.time.values / interval
    regular = np.abs(steps - np.round(steps)) < 1e-9 * np.maximum(steps, 1.0)
    located = run.event_time.values[run.event_kind.isin(["opening", "closing"]).values]
    return run.isel(time=np.flatnonzero(regular | np.isin(run.time.values, located)))


#: scene -> its end; share of the largest value by which turned vectors may differ, and positions. An ideal motion is
#: what the drives prescribe, to projection (1e-13 m). With contacts the steps differ a little, as the largest component
#: of a vector depends on the axes: errors of rtol 1e-12 grow some ten times, and a contact of 1e-4 s that comes
#: 1e-11 s earlier differs by 1e-7 of its force
RUNS = {IDEAL: ("0.18 s", 1e-9, 1e-9), CSJ: ("0.06 s", 1e-7, 1e-9), BOUNCE: ("0.99 s", 1e-7, 1e-9)}
every_run = pytest.mark.parametrize("name", RUNS)


@every_run
def test_a_scene_turned_and_shifted_moves_just_as_it_did(name: str) -> None:
    end, fraction, near = RUNS[name]
    here, there = here_and_there(name, end)
    assert len(here.time) == len(there.time)
    size = largest(here.position - here.position.isel(time=0))
    assert largest(there.position.values - (here.position.values @ TURN.T + SHIFT)) <= near * size
    for field in ("velocity", "angular_velocity", "acceleration", "joint_force"):
        known = here[field].values @ TURN.T
        assert largest(there[field].values - known) <= fraction * max(largest(known), 1e-3), field
    turned = TURN @ quaternion_to_matrix(here["quaternion"].values)
    assert largest(quaternion_to_matrix(there["quaternion"].values) - turned) <= near


@pytest.mark.parametrize("name", [CSJ, BOUNCE])
def test_its_impacts_stay_the_same(name: str) -> None:
    here, there = (impacts(d) for d in here_and_there(name, RUNS[name][0]))
    assert len(here["start"]) >= 3
    for field in ("start", "approach"):
        assert there[field] == pytest.approx(here[field], rel=RUNS[name][2]), field
    # the peak is read from samples of the dense output by a parabola
    assert there["peak_force"] == pytest.approx(here["peak_force"], rel=1e-3)


@every_run
def test_energies_do_not_depend_on_the_axes(name: str) -> None:
    here, there = here_and_there(name, RUNS[name][0])
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


@cache
def original(name: str) -> tuple[Table, xr.Dataset]:
    table = table_of(name, **{"time.end": RUNS[name][0], "solver": {"rtol": 1e-12}})
    return table, here_and_there(name, RUNS[name][0])[0]


@pytest.mark.parametrize("name", [IDEAL, CSJ])
@pytest.mark.parametrize("rewrite", [reordered, reversed_joints], ids=lambda f: f.__name__)
def test_the_motion_does_not_depend_on_how_the_mechanism_is_written(name: str, rewrite: Any) -> None:
    """Other trees, other coordinates, other error groups, one motion."""
    table, known = original(name)
    found = comparable(simulate(rewrite(table)))
    assert len(found.time) == len(known.time)
    found = found.sel(body=known.body.values)
    fraction = RUNS[name][1]
    for field in ("position", "velocity", "angular_velocity", "acceleration"):
        assert largest(found[field].values - known[field].values) <= fraction * largest(known[field]), field


@pytest.mark.parametrize("rewrite", [reordered, reversed_joints], ids=lambda f: f.__name__)
def test_reactions_do_not_depend_on_how_the_mechanism_is_written(rewrite: Any) -> None:
    table, known = original(IDEAL)
    found = simulate(rewrite(table)).sel(joint=known.joint.values)
    sign = -1.0 if rewrite is reversed_joints else 1.0
    # spherical joints: whichever frame comes first, the force passes through one point
    names = [n for n, j in table["joint"].items() if j["type"] == "spherical"]
    a, b = (d.joint_force.sel(joint=names).values for d in (found, known))
    assert largest(sign * a - b) <= 1e-8 * largest(b)
    drives = known.drive.values
    a, b = (d.drive_force.sel(drive=drives).values for d in (found, known))
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
