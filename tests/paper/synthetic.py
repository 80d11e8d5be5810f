"""A made-up run in the shape of the real ones, so that figures and tables can be tested without an engine.

The platform follows a smooth stroke; bodies, frames and joints are those of the paper's mechanism.
Contact forces are bursts at regular times.  Nothing here is physics; only names, shapes and orders
of magnitude are those of the mechanism.
"""

import json

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from flexclear.artifacts.schema import BUNDLE, ENSEMBLE, RUN, conform
from flexclear.numerics.rotations import quaternion_to_matrix

END, INTERVAL = 0.18, 1e-4
A = 1e-3 * np.array([[86.603, 50, 0], [86.603, -50, 0], [-86.603, 50, 0], [-86.603, -50, 0]])
B = 1e-3 * np.array([[100, 173.205, 0], [100, -173.205, 0], [-100, 173.205, 0], [-100, -173.205, 0]])
ROD_INERTIA = (9.96802e-4, 9.96802e-4, 1.0330e-5)
CYLINDER_INERTIA = (7.991531e-3, 7.991531e-3, 4.15648e-4)
BURSTS = np.arange(0.012, 0.176, 0.008)
BURST_LENGTH = 2e-4


def stroke(t: np.ndarray) -> np.ndarray:
    """0 -> 1 -> 0, two cubics."""
    s = np.where(t < 0.09, t / 0.09, (0.18 - t) / 0.09)
    return s * s * (3.0 - 2.0 * s)


def run(name: str = "sps4/ideal", *, clearance: bool = False, modes: int = 0, noise: float = 0.0) -> xr.Dataset:
    """A dataset of schema RUN. noise: size of a deviation from the ideal motion [m]."""
    regular = np.linspace(0.0, END, round(END / INTERVAL) + 1)
    extra = np.concatenate([BURSTS, BURSTS + BURST_LENGTH]) + 3.3e-5 if clearance else np.empty(0)
    time = np.union1d(regular, extra)
    wobble = noise * np.sin(2 * np.pi * 300.0 * time) * np.minimum(time / 0.02, 1.0)
    z = 0.0313 * stroke(time) + wobble
    tilt = -0.373 * stroke(time) + wobble / 0.1
    bodies, position, quaternion, frames, frame_body, frame_position = _bodies(time, z, tilt)
    velocity = np.gradient(position, time, axis=0)
    data = {
        "position": (("time", "body", "axis"), position),
        "quaternion": (("time", "body", "quat"), quaternion),
        "velocity": (("time", "body", "axis"), velocity),
        "angular_velocity": (("time", "body", "axis"), np.zeros_like(position)),
        "acceleration": (("time", "body", "axis"), np.gradient(velocity, time, axis=0)),
        "angular_acceleration": (("time", "body", "axis"), np.zeros_like(position)),
        "frame_position": (("time", "frame", "axis"), frame_position),
    }
    joints = ["A1", "A2", "B1", "P1"]
    force = 30.0 * np.cos(np.pi * time / 0.09)[:, None, None] * np.ones((1, len(joints), 3)) / np.sqrt(3.0)
    data["joint_force"] = (("time", "joint", "axis"), force)
    data["joint_moment"] = (("time", "joint", "axis"), np.zeros_like(force))
    for energy in ("kinetic", "potential", "elastic", "dissipated", "drive_work", "energy_error", "constraint_error"):
        data[energy] = (("time",), np.zeros_like(time))
    coords = {"time": time, "body": bodies, "frame": frames, "joint": joints}
    coords["frame_body"] = ("frame", frame_body)
    if clearance:
        data |= _contact(time)
        coords["contact"] = ["A1"]
    if modes:
        wave = [1e-5 / (k + 1) * np.sin(2 * np.pi * 40.0 * (k + 1) * time) for k in range(modes)]
        data["modal_coordinate"] = (("time", "mode"), np.stack(wave, axis=1))
        coords["mode"] = [f"rod1.{k + 1}" for k in range(modes)]
        coords["mode_body"] = ("mode", ["rod1"] * modes)
    attrs = {
        "scene": name,
        "title": f"made-up {name}",
        "parameters": json.dumps(_parameters(clearance)),
        "evaluations": 1000,
        "steps": 100,
        "projections": 10,
    }
    attrs["assumptions"] = json.dumps({"joint.A1.normal.restitution": "assumed: not printed in the paper"})
    return conform(xr.Dataset(data, coords), RUN, **attrs)


def _bodies(time, z, tilt):
    count = time.size
    height = np.array([0.0, 0.0, 0.35])
    q_platform = np.stack([np.cos(tilt / 2), 0 * tilt, np.sin(tilt / 2), 0 * tilt], axis=1)
    R = quaternion_to_matrix(q_platform)
    p_platform = height + np.stack([0 * z, 0 * z, z], axis=1)
    bodies, position, quaternion = ["platform"], [p_platform], [q_platform]
    frames, owners, places = ["platform.C"], ["platform"], [p_platform]
    for k in range(4):
        top = p_platform + R @ A[k]
        foot = np.broadcast_to(B[k], (count, 3))
        axis = top - foot
        length = np.linalg.norm(axis, axis=1, keepdims=True)
        axis = axis / length
        q_leg = np.roll(Rotation.from_matrix(_leg(axis)).as_quat(), 1, axis=1)  # x y z w -> w x y z
        for body, at in (
            ("cylinder", foot + 0.146 * axis),
            ("rod", top - 0.160 * axis),
            ("ball_A", top - 0.00545 * axis),
            ("ball_B", foot + 0.00545 * axis),
        ):
            bodies.append(f"{body}{k + 1}")
            position.append(at)
            quaternion.append(q_leg)
        for frame, at in (
            (f"platform.A{k + 1}", top), (f"ground.B{k + 1}", foot),
            (f"ball_A{k + 1}.centre", top), (f"ball_B{k + 1}.centre", foot),
            (f"cylinder{k + 1}.bottom", foot + 0.04 * axis), (f"cylinder{k + 1}.P", foot + 0.2 * axis),
            (f"rod{k + 1}.bottom", top - 0.28 * axis), (f"rod{k + 1}.top", top - 0.04 * axis),
        ):  # fmt: skip
            frames.append(frame)
            owners.append(frame.partition(".")[0])
            places.append(at)
    arrays = (np.stack(position, axis=1), np.stack(quaternion, axis=1))
    fixed = np.broadcast_to([0.0, 0.0, 0.07], (count, 3))
    for frame, at in (("ground.Z", fixed), ("central_rod.Z", p_platform - [0.0, 0.0, 0.28])):
        frames.append(frame)
        owners.append(frame.partition(".")[0])
        places.append(at)
    return bodies, *arrays, frames, owners, np.stack(places, axis=1)


def _leg(axis: np.ndarray) -> np.ndarray:
    x = np.cross([0.0, 0.0, 1.0], axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(axis, x), axis], axis=2)


def _contact(time: np.ndarray) -> dict:
    phase = (time[:, None] - (BURSTS + 3.3e-5)[None, :]) / BURST_LENGTH
    pulse = np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)), 0.0)
    normal = (pulse * (1500.0 + 100.0 * np.arange(BURSTS.size))).sum(axis=1)
    depth = (normal / 1.3631e11) ** (2.0 / 3.0)
    swing = 0.5e-3 * np.abs(np.cos(np.pi * (time - BURSTS[0]) / 0.008))
    radius = np.where(depth > 0, 0.5e-3 + depth, np.minimum(swing, 0.4999e-3))
    turn = 2 * np.pi * 3.0 * time
    offset = radius[:, None] * np.stack([np.cos(turn), np.sin(turn), 0.2 * np.sin(turn)], axis=1)
    offset *= (radius / np.maximum(np.linalg.norm(offset, axis=1), 1e-12))[:, None]
    force = -normal[:, None] * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    tangent = 0.1 * normal[:, None] * np.stack([0 * turn, 0 * turn, 1 + 0 * turn], axis=1)
    n = BURSTS.size
    events = np.sort(np.concatenate([BURSTS, BURSTS + BURST_LENGTH]) + 3.3e-5)
    closing = np.arange(2 * n) % 2 == 0
    nan = np.where(closing, 1.0, np.nan)
    return {
        "contact_gap": (("time", "contact"), (0.5e-3 - radius)[:, None]),
        "contact_penetration": (("time", "contact"), depth[:, None]),
        "contact_rate": (("time", "contact"), np.zeros((time.size, 1))),
        "contact_force": (("time", "contact", "axis"), (force + tangent)[:, None, :]),
        "contact_normal_force": (("time", "contact"), normal[:, None]),
        "contact_friction_power": (("time", "contact"), -0.02 * np.linalg.norm(tangent, axis=1)[:, None]),
        "contact_offset": (("time", "contact", "axis"), offset[:, None, :]),
        "contact_delivered_restitution": (("contact",), np.array([0.913])),
        "event_time": (("event",), events),
        "event_contact": (("event",), np.full(2 * n, "A1")),
        "event_kind": (("event",), np.where(closing, "closing", "opening")),
        "event_approach_speed": (("event",), np.where(closing, 0.2, 0.18)),
        "event_peak_force": (("event",), nan * 1800.0),
        "event_peak_penetration": (("event",), nan * 5e-6),
        "event_duration": (("event",), nan * BURST_LENGTH),
    }


def _parameters(clearance: bool) -> dict:
    def rigid(mass, inertia):
        return {"type": "rigid", "mass": mass, "com": [0, 0, 0], "inertia": np.diag(inertia).tolist()}

    body = {
        "platform": rigid(0.31, (1.040159e-3, 1.040159e-3, 2.080267e-3)),
        "ground": {"type": "ground", "frames": {}},
        "central_rod": rigid(0.59, (2.837976e-3, 2.837976e-3, 2.9409e-5)),
        "socket_A1": rigid(0.30, (9.8769e-5, 9.8769e-5, 1.274e-4)),
    }
    for k in range(1, 5):
        body[f"cylinder{k}"] = rigid(2.08, CYLINDER_INERTIA)
        body[f"rod{k}"] = rigid(0.21, ROD_INERTIA)
        body[f"ball_A{k}"] = body[f"ball_B{k}"] = rigid(0.36, (8.5866e-5, 8.5866e-5, 4.6728e-5))
    joint = {f"A{k}": {"type": "spherical", "between": [f"platform.A{k}", f"ball_A{k}.centre"]} for k in range(1, 5)}
    joint |= {f"B{k}": {"type": "spherical", "between": [f"ground.B{k}", f"ball_B{k}.centre"]} for k in range(1, 5)}
    if clearance:
        friction = {"law": "modified-coulomb", "static": 0.15, "dynamic": 0.1, "v_static": 2e-4, "v_dynamic": 1e-2}
        joint["A1"] |= {"type": "clearance-spherical", "clearance": 5e-4, "ball_radius": 0.02, "friction": friction}
        steel = {"youngs_modulus": 2.068e11, "poisson": 0.29}
        joint["A1"] |= {"socket_material": steel, "ball_material": steel}
        joint["A1"]["normal"] = {"law": "lankarani-nikravesh", "restitution": 0.9}
    return {"body": body, "joint": joint}


def ensemble(base: xr.Dataset, members: int = 4, growth: float = 60.0) -> xr.Dataset:
    """Members that leave `base` exponentially (schema ENSEMBLE), on the regular output times."""
    regular = base.isel(
        time=[i for i, t in enumerate(base.time.values) if abs(t / INTERVAL - round(t / INTERVAL)) < 1e-6]
    )
    kept = regular.sel(body=["platform"])
    time = kept.time.values
    sign = np.linspace(-1.0, 1.0, members)[:, None, None, None]
    grown = sign * (1e-9 * np.exp(growth * 2 * time)).clip(max=1e-3)[None, :, None, None]
    data = {
        name: (("member", *kept[name].dims), np.repeat(kept[name].values[None], members, axis=0))
        for name in ("quaternion", "angular_velocity")
    }
    for name, factor in (("position", 1e-2), ("velocity", 1.0), ("acceleration", 1e3)):
        data[name] = (("member", *kept[name].dims), kept[name].values[None] + factor * grown)
    normal, offset = kept.contact_normal_force.values, kept.contact_offset.values
    data["contact_normal_force"] = (("member", "time", "contact"), np.repeat(normal[None], members, axis=0))
    data["contact_offset"] = (("member", "time", "contact", "axis"), np.repeat(offset[None], members, axis=0))
    for name, value in (("impact_count", 21.0), ("peak_force", 1800.0), ("contact_time_share", 0.02)):
        data[name] = (("member", "contact"), np.full((members, 1), value) + np.arange(members)[:, None])
    peak = np.abs(data["acceleration"][1]).max(axis=1)
    data["peak_acceleration"] = (("member", "body", "axis"), peak)
    data["peak_speed"] = (("member", "body"), np.linalg.norm(data["velocity"][1], axis=-1).max(axis=1))
    made = xr.Dataset(data, {"time": time, "body": ["platform"], "contact": ["A1"]})
    return conform(made, ENSEMBLE, title="made-up members")


def rod_shapes(count: int, nodes: int = 13) -> np.ndarray:
    """Transverse half waves along a rod of 0.24 m, alternately in y and z; shape (node, axis, mode)."""
    s = np.linspace(0.0, 1.0, nodes)
    shape = np.zeros((nodes, 3, count))
    for k in range(count):
        shape[:, 1 + k % 2, k] = 3.0 * np.sin(np.pi * (k // 2 + 1) * s)
    return shape


def bundle(count: int = 7, nodes: int = 13, frequency: np.ndarray | None = None) -> xr.Dataset:
    """A made-up rod of schema BUNDLE."""
    x = np.zeros((nodes, 3))
    x[:, 0] = np.linspace(0.0, 0.24, nodes)
    frequency = 1500.0 * (1 + np.arange(count) // 2) if frequency is None else frequency
    shape, eye = rod_shapes(count, nodes), np.eye(count)
    cell = np.stack([np.arange(nodes - 1), np.arange(1, nodes)], axis=1)
    data = {
        "mass": ((), 0.2066), "first_moment": (("axis",), np.zeros(3)), "second_moment": (("axis", "axis2"), np.eye(3)),
        "modal_first_moment": (("axis", "mode"), np.zeros((3, count))),
        "position_mode_moment": (("axis", "axis2", "mode"), np.zeros((3, 3, count))),
        "mode_mode_moment": (("axis", "axis2", "mode", "mode2"), np.zeros((3, 3, count, count))),
        "second_order_moment": (("axis", "axis2", "mode", "mode2"), np.zeros((3, 3, count, count))),
        "untilted_inertia": (("axis", "axis2"), np.zeros((3, 3))),
        "modal_mass": (("mode", "mode2"), eye), "modal_stiffness": (("mode", "mode2"), eye),
        "frequency": (("mode",), frequency),
        "frame_position": (("frame", "axis"), x[[0, -1]]),
        "frame_rotation": (("frame", "axis", "axis2"), np.stack([np.eye(3)] * 2)),
        "frame_translation_shape": (("frame", "axis", "mode"), shape[[0, -1]]),
        "frame_rotation_shape": (("frame", "axis", "mode"), 0 * shape[[0, -1]]),
        "node_position": (("node", "axis"), x), "cell_node": (("cell", "corner"), cell),
        "shape_translation": (("node", "axis", "mode"), shape), "shape_rotation": (("node", "axis", "mode"), 0 * shape),
        "radius": (("cell",), np.full(nodes - 1, 0.01)),
    }  # fmt: skip
    return conform(xr.Dataset(data, {"frame": ["bottom", "top"]}), BUNDLE, title="made-up rod")


def timing() -> xr.Dataset:
    """Made-up times of the six models of table 10: three repeats of each integration, and a record far longer."""
    scenes = ["sps4/ideal", "sps4/far_free", "sps4/far_fixed", "sps4/csj", "sps4/far_csj_free", "sps4/far_csj_fixed"]
    seconds = np.outer([0.004, 0.02, 0.02, 0.04, 0.3, 0.4], [1.0, 1.1, 0.9])
    slow = np.where(np.arange(6)[:, None] == 2, np.nan, 5.0 * seconds)
    data = {}
    for way, times in (("equal", seconds), ("step", slow), ("tolerance", 2.0 * seconds), ("size", 3.0 * seconds)):
        data |= {
            f"{way}_integration_seconds": (("scene", f"{way}_repeat"), times),
            f"{way}_recording_seconds": (("scene", f"{way}_recorded"), np.full((6, 1), 0.1)),
            f"{way}_evaluations": (("scene",), np.array([1e3, 2e3, 2e3, 2e4, 5e4, 6e4])),
            f"{way}_steps": (("scene",), np.array([20.0, 80.0, 21.0, 400.0, 4e3, 4e3])),
            f"{way}_energy_error": (("scene",), np.full(6, 1e-4)),
            f"{way}_rtol": (("scene",), np.full(6, 1e-8)),
        }
    attributes = {"equal_error": 1e-6, "share": 0.05, "step": 1e-5, "refused": "sps4/far_fixed: unstable"}
    attributes |= {"tolerance": 4e-6, "damped": "radau"}
    return xr.Dataset(data, {"scene": scenes}, attributes)
