"""Scenes from robots' files against MuJoCo, which compiles the same files: equations of motion, and free motion.

The models come with packages (`pip install --no-deps gymnasium dm-control example-robot-data`); those that are not
installed are left out.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.family import Case, Family, Record, each
from benchmarks.mechanisms import Mechanism
from benchmarks.page import Columns, short, table
from flexclear.artifacts.quantities import evaluate
from flexclear.dynamics.model.model import Model
from flexclear.dynamics.run.evaluation import closure_rows
from flexclear.dynamics.run.evaluation.matrices import Matrices, holding_forces
from flexclear.numerics.rotations import quaternion_to_matrix
from flexclear.scene.load import scene_of
from flexclear.scene.schema import Scene
from flexclear.stages import scenes
from flexclear.stages.robots.files import Robot, read
from flexclear.stages.robots.text import Draft

SUITE, GYM, DATA = "dm_control/suite", "gymnasium/envs/mujoco/assets", "cmeel.prefix/share/example-robot-data/robots"
#: models: distribution and path in it
MODELS = {
    "fish": ("dm-control", f"{SUITE}/fish.xml"),
    "acrobot": ("dm-control", f"{SUITE}/acrobot.xml"),
    "quadruped": ("dm-control", f"{SUITE}/quadruped.xml"),
    "jaco arm": ("dm-control", "dm_control/third_party/kinova/jaco_arm.xml"),
    "manipulator": ("dm-control", f"{SUITE}/manipulator.xml"),
    "inverted double pendulum": ("gymnasium", f"{GYM}/inverted_double_pendulum.xml"),
    "half cheetah": ("gymnasium", f"{GYM}/half_cheetah.xml"),
    "ant": ("gymnasium", f"{GYM}/ant.xml"),
    "humanoid": ("gymnasium", f"{GYM}/humanoid.xml"),
    "UR5": ("example-robot-data", f"{DATA}/ur_description/urdf/ur5_robot.urdf"),
    "Panda": ("example-robot-data", f"{DATA}/panda_description/urdf/panda.urdf"),
    "Go2": ("example-robot-data", f"{DATA}/go2_description/urdf/go2.urdf"),
    "Talos": ("example-robot-data", f"{DATA}/talos_data/robots/talos_full_v2.urdf"),
}
#: random poses of each model; time steps of MuJoCo's RK4 [s]; length of the free motion [s]
POSES, STEPS, LENGTH = 10, (2e-3, 1e-3, 5e-4), 1.0
#: loads of a scene that free motion has not
DRIVEN = ("pid", "joint-force", "point-force", "point-torque")


def cases() -> list[Case]:
    """Return the models; those of packages that are not installed have no records."""
    return [Case(name, [package]) for name, (package, _) in MODELS.items()]


def _path(name: str) -> Path | None:
    package, inner = MODELS[name]
    try:
        return Path(str(distribution(package).locate_file(inner)))
    except PackageNotFoundError:
        return None


def _record(case: Case) -> list[Record]:
    path = _path(case.name)
    if path is None:
        return []
    robot, written = pair(path)
    return [
        {
            "by": case.name,
            "file": f"{path.name} of {case.of[0]} {version(case.of[0])}",
            "bodies": robot.model.nbody - 1,
            "speeds": int(robot.model.nv),
            "version": robot.version,
            **equations(robot, written, POSES),
            # MuJoCo's equality constraints are soft, and scenes lack its tendons
            "motion": [] if robot.model.neq or robot.model.ntendon else free_motion(robot, written, STEPS),
        }
    ]


def pair(path: Path) -> tuple[Robot, dict[str, Any]]:
    """Return the compiled model of a file, and its scene as a table, without what pictures show."""
    from flexclear.stages.robots import scene

    robot = read(path)
    written = tomllib.loads(scene.scene_of(robot, path, "robot")[0])
    for body in written["body"].values():
        body["geometry"] = []
    return robot, written


def coordinates(robot: Robot) -> list[Any]:
    """Return the joints of a model with their names in its scene."""
    from flexclear.stages.robots.mechanism import Assembly, take_bodies

    at = Assembly(robot.model, Draft(), robot.model.qpos0, np.zeros(robot.model.nv))
    take_bodies(at)
    return list(at.joints.values())


def equations(robot: Robot, written: dict[str, Any], poses: int) -> Record:
    """Return the largest differences of mass matrix, gravity and bias forces in random poses, as fractions of the
    largest entry; loops are open, and rotors turn with their joints."""
    import mujoco

    model, data = robot.model, mujoco.MjData(robot.model)
    gears = [(gear["first"], gear["second"]) for name, gear in written.get("gear", {}).items() if "rotor" in name]
    engine = Mechanism("open", opened(written), {}).engine()
    joints, rng, apart = coordinates(robot), np.random.default_rng(48), np.zeros(3)
    for _ in range(poses):
        q, v = np.array(model.qpos0), rng.normal(size=model.nv)
        y, S = np.zeros(engine.model.ny), np.zeros((engine.model.nv, model.nv))
        _pose(engine.model, joints, rng, q, y, S)
        for first, second in gears:
            (here, sign), (there, other) = (_speeds(engine.model, joint) for joint in (first, second))
            S[there[0]] = sign * other * S[here[0]]
        forces = []
        for motion in (v, np.zeros(model.nv)):
            y[engine.model.nq : engine.model.nq + engine.model.nv] = S @ motion
            closure_rows.evaluate(engine, y, 0.0)
            data.qpos[:], data.qvel[:] = q, motion
            mujoco.mj_forward(model, data)
            forces.append((S.T @ holding_forces(engine)[0], np.array(data.qfrc_bias)))
        L, M = Matrices(engine).factor, np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        pairs = [(S.T @ (L @ L.T) @ S, M), forces[0], forces[1]]
        apart = np.maximum(apart, [np.abs(a - b).max() / max(np.abs(b).max(), 1e-300) for a, b in pairs])
    return dict(zip(("mass", "bias", "gravity"), apart.tolist(), strict=True))


def opened(written: dict[str, Any]) -> Scene:
    """Return a scene with gravity alone: without what acts on joints, closes loops or couples coordinates."""
    loads = {name: load for name, load in written.get("load", {}).items() if load["type"] == "gravity"}
    text = "closes a loop"
    joints = {name: joint for name, joint in written["joint"].items() if text not in joint.get("source", "")}
    left = {key: written[key] for key in ("title", "time", "output", "body")}
    return scene_of({**left, "joint": joints, "load": loads})


def _speeds(model: Model, joint: str) -> tuple[list[int], float]:
    """Return the speeds of a joint of the tree, and the sign of its coordinate there."""
    i, link = _link(model, joint)
    return list(model.numbering.coordinates[i]), link.joint.sign


def _link(model: Model, joint: str) -> tuple[int, Any]:
    found = ((i, link) for i, link in enumerate(model.links) if link.branch.edge and link.branch.edge.name == joint)
    return next(found)


def _pose(
    model: Model, joints: Sequence[Any], rng: np.random.Generator, q: np.ndarray, y: np.ndarray, S: np.ndarray
) -> None:
    """Set a random pose in both programs, and the map from MuJoCo's speeds to those of the tree."""
    for one in joints:
        first = model.numbering.positions[_link(model, one.joint)[0]].start
        speeds, sign = _speeds(model, one.joint)
        if one.single:
            q[one.address] = rng.uniform(-1.0, 1.0)
            y[first], S[speeds[0], one.speed] = sign * q[one.address], sign
            continue
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        R, free = quaternion_to_matrix(quaternion), one.type == "free"
        turned = one.address + 3 * free
        q[turned : turned + 4], y[first : first + 4] = quaternion, quaternion
        # angular velocities are in the axes of the body there, in those of the first frame here
        S[np.ix_(speeds[:3], range(one.speed + 3 * free, one.speed + 3 * free + 3))] = R
        if free:
            q[one.address : turned] = y[first + 4 : first + 7] = rng.normal(size=3)
            S[np.ix_(speeds[3:], range(one.speed, one.speed + 3))] = np.eye(3)


def free_motion(robot: Robot, written: dict[str, Any], steps: Sequence[float]) -> list[float]:
    """Return the largest difference of a coordinate [m, rad] or a centre of mass [m] after free motion, per time step.

    Springs, dampers, loops and rotors act; limits, friction loss, contacts and actuators do not, in either program.
    """
    import mujoco

    model, disable = robot.model, mujoco.mjtDisableBit
    off = [disable.mjDSBL_CONTACT, disable.mjDSBL_LIMIT, disable.mjDSBL_FRICTIONLOSS, disable.mjDSBL_ACTUATION]
    model.opt.disableflags |= sum(int(flag) for flag in off)
    model.opt.density, model.opt.viscosity, model.opt.integrator = 0.0, 0.0, mujoco.mjtIntegrator.mjINT_RK4
    rng, joints = np.random.default_rng(48), [one for one in coordinates(robot) if one.single]
    q, v = np.array(model.qpos0), np.zeros(model.nv)
    for one in joints:
        q[one.address] += rng.uniform(-0.3, 0.3)
        v[one.speed] = rng.uniform(-1.0, 1.0)
    start = {one.joint: {"position": float(q[one.address]), "velocity": float(v[one.speed])} for one in joints}
    run = scenes.run(scene_of(_free(written, start)))
    ours = [evaluate(run, f"{one.joint}.position").values[-1] for one in joints]
    return [float(max(_apart(model, joints, ours, run, state))) for state in map(partial(_moved, model, q, v), steps)]


def _free(written: dict[str, Any], start: dict[str, Any]) -> dict[str, Any]:
    """Return the table of a scene without limits, friction loss and actuators, with a start."""
    loads = {name: dict(load) for name, load in written.get("load", {}).items() if load["type"] not in DRIVEN}
    for load in loads.values():
        load.pop("coulomb", None)
    loads = {name: load for name, load in loads.items() if load["type"] != "joint-friction" or load["viscous"]}
    changed = {"load": loads, "stop": {}, "start": {"joint": start}, "output": {"interval": LENGTH / 10}}
    return {**written, **changed, "time": {"end": LENGTH}, "solver": {"integrator": "dop853", "rtol": 1e-12}}


def _moved(model: Any, q: np.ndarray, v: np.ndarray, step: float) -> Any:
    """Return MuJoCo's state after the free motion with a time step."""
    import mujoco

    data, model.opt.timestep = mujoco.MjData(model), step
    data.qpos[:], data.qvel[:] = q, v
    for _ in range(round(LENGTH / step)):
        mujoco.mj_step(model, data)
    mujoco.mj_kinematics(model, data)
    return data


def _apart(model: Any, joints: Sequence[Any], ours: Sequence[float], run: Any, data: Any) -> Iterator[float]:
    """Yield the differences of coordinates, and of centres of mass of bodies of the same name."""
    yield from (abs(mine - data.qpos[one.address]) for one, mine in zip(joints, ours, strict=True))
    for b in range(1, model.nbody):
        if (name := model.body(b).name) in run["body"].values and model.body_jntnum[b]:
            yield float(np.abs(run["position"].sel(body=name).values[-1] - data.xipos[b]).max())


def show(records: list[Record]) -> str:
    """Return the table of the models, with the program's version."""
    columns: Columns = {
        "model": lambda r: r["by"],
        "file": lambda r: r["file"],
        "bodies": lambda r: str(r["bodies"]),
        "speeds": lambda r: str(r["speeds"]),
        "mass matrix": lambda r: short(r["mass"]),
        "gravity": lambda r: short(r["gravity"]),
        "bias": lambda r: short(r["bias"]),
        **{f"motion, {1e3 * h:g} ms": partial(_moved_by, k) for k, h in enumerate(STEPS)},
    }
    return f"{table(records, columns)}\n\nMuJoCo {records[-1]['version']}."


def _moved_by(k: int, r: Record) -> str:
    """Return the cell of the free motion with a time step; empty where there is none to compare with."""
    return short(r["motion"][k]) if r["motion"] else ""


FAMILY = Family(
    what="scenes from robots' files against MuJoCo",
    takes="5 min",
    page="exchange.md",
    cases=cases,
    measure=each(_record),
    show=show,
    rows="double pendulum|UR5|Talos",
    needs=("mujoco", "robots"),
)
